"""Benchmarks: what an image costs and how right it is (`speed`), how long the first one takes (`start`), whether two
renderers that nobody here wrote draw the same (`agreement`), what many spheres cost beside them (`scaling`), what the
plan is worth (`scenes`), and whether random scenes are drawn as brute force and the oracle say (`random-scenes`).

    python -m benchmarks speed [--size 256 1024] [--rounds 15] [--shininess 32] [--points 65536] [--json]
    python -m benchmarks start [--size 256] [--rounds 7] [--json]
    python -m benchmarks agreement [SCENE ...] [--size 512] [--rounds 5] [--out FOLDER] [--json]
    python -m benchmarks scaling [--counts 1 10 100 1000 10000] [--size 512] [--rounds 9] [--quick] [--json]
    python -m benchmarks scenes [SCENE ...] [--size 512] [--rounds 9] [--json]
    python -m benchmarks random-scenes [--count 2000] [--width 24] [--height 20] [--jobs N] [--json]

The peers are POV-Ray 3.7 (Debian: apt-get install povray) and Mitsuba 3 (pip install mitsuba, and libLLVM: apt-get
install libllvm15). One that is missing is named, and the rest is measured.

Run from the root of a clone. Contestants take turns within each round of one run, and every time is a median with its
quartiles: read ratios, and distrust differences under a tenth.
"""
