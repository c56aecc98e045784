"""Benchmarks: what an image costs and how right it is (`speed`), also beside other compilers (`peers`), how far a
kernel is from what the machine can do (`roofline`), how long the first image takes (`start`), what more spheres, lights
and pixels cost (`scaling`), what the plan (`scenes`) and each accuracy (`levels`) are worth, whether two renderers that
nobody here wrote draw the same (`agreement`), and whether random scenes are right (`random-scenes`).

    python -m benchmarks speed [--size 256 1024] [--rounds 15] [--shininess 32] [--points 65536] [--json]
    python -m benchmarks peers [--quick] [--plot FILE] [--size 1024] [--rounds 15] [--threads 1 2] [--json]
    python -m benchmarks roofline [--sizes 128 512 4096] [--rounds 9] [--plot FILE] [--json]
    python -m benchmarks start [--size 256] [--rounds 7] [--json]
    python -m benchmarks agreement [SCENE ...] [--size 512] [--rounds 5] [--out FOLDER] [--json]
    python -m benchmarks scaling [spheres] [lights] [sizes] [compile] [--size 512] [--rounds 9] [--quick] [--json]
    python -m benchmarks levels [SCENE ...] [--size 256] [--rounds 9] [--points 2000] [--json]
    python -m benchmarks scenes [SCENE ...] [--size 512] [--rounds 9] [--json]
    python -m benchmarks hand-over [--scenes 2400] [--points 1000] [--json]
    python -m benchmarks.calls
    python -m benchmarks.processors
    python -m benchmarks promises [--count 500] [--others 160] [--json]
    python -m benchmarks random-scenes [--count 2000] [--width 24] [--height 20] [--jobs N] [--json]

Other renderers are POV-Ray 3.7 (Debian: apt-get install povray) and Mitsuba 3 (pip install mitsuba, and libLLVM:
apt-get install libllvm15); other compilers come with pip install '.[peers]'. What is missing is named, and the rest is
measured. docs/benchmarks.md says how to read each.

Run from the root of a clone. Contestants take turns within each round of one run, and every time is a median with its
quartiles, a sample being the fastest call of some 15 ms: read ratios, and distrust differences under a tenth.
"""
