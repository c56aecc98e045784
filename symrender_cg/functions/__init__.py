"""Elementary functions that the kernels bring along: the scripts that derive their coefficients, and the proofs.

    minimax.py     a function -> the polynomial of least weighted error             (mpmath)
    supremum.py    the rounded polynomial -> a rigorous bound of its error          (Arb)
    rounding.py    the C text's operations -> a rigorous bound of their roundings   (Arb)
    power.py       the tables of base^exponent, in double and float
    header.py      the tables -> templates/support/power.h

`python -m symrender_cg.functions` prints the tables and their bounds; with `--write` it regenerates the header. This is
needed to make the header, never to compile or run a kernel.
"""
