"""What accuracy costs in time: measured over variants of one scene, shown, and used to choose.

    variants.py    the ways to draw a scene: levels, choices, baked, planned otherwise, numpy, lambdify, supersampling
    ready.py       a way made ready: compiled, with its C, its lines and operations, and what building it took
    sample.py      points, the truth there, and how far values are from it
    timing.py      interleaved rounds
    search.py      which ways are tried: from every level coordinate by coordinate, within a budget
    front.py       what is dominated by what, and what each step along the front buys
    report.py      the results as data; store.py keeps them by scene and machine
    break_even.py  what a specialisation costs to build, saves a pixel, and after how many pixels it pays
    effects.py     the time of a scene with one effect after the other
    choose.py      the fastest way whose bound meets what is asked for; asked.py: for render_image and evaluate
    walk.py        which ways a request looks at, and when it stops; expected.py: in which order
    looking.py     what it measures; records.py: what is kept of that, and of what `cost` measured
    chart.py, html.py   pictures of a report

Comes in: a Scene. Goes out: a Report, or a Choice. Never done here: a kernel; the pipeline makes them.
"""

from __future__ import annotations
