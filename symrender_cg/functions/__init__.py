"""Elementary functions that the kernels bring along: the scripts that derive their coefficients, and the proofs.

    minimax.py            a function -> the polynomial of least weighted error                       (mpmath)
    supremum.py           the rounded polynomial -> a rigorous bound of its error                    (Arb)
    rounding.py           the C text's operations -> a rigorous bound of their roundings             (Arb)
    pair_rounding.py      the same for numbers in two doubles                                        (Arb)
    power.py              the tables of base^exponent, in double and float          -> power.h
    fast.py               the short tables for grey levels                          -> fast_power.h
    pairs.py              the tables of powers to 69 and to 90 bits                 -> precise_power.h
    elementary.py         bounds of exp2, log2, expm1, log1p and pow                -> elementary.h
    elementary_pairs.py   the same in double-double
    *header.py            the tables -> templates/support

`python -m symrender_cg.functions` prints the tables and their bounds; with `--write` it regenerates the headers. This
is needed to make the headers, never to compile or run a kernel.
"""
