"""Benchmarks: what an image costs and how right it is (`speed`), and how long the first one takes (`start`).

    python -m benchmarks speed [--size 256 1024] [--rounds 15] [--shininess 32] [--points 65536] [--json]
    python -m benchmarks start [--size 256] [--rounds 7] [--json]

Run from the root of a clone. Contestants take turns within each round of one run, and every time is a median with its
quartiles: read ratios, and distrust differences under a tenth.
"""
