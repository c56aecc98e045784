"""`python -m benchmarks roofline`: how far each kernel is from what the machine can do.

`counting` takes the operations of a pixel from the lowered program, `peaks` measures the machine by loops of C under
the kernels' own flags, `measure` times the kernels in the same run and puts both together, `report` and `chart` show
it.
"""

from __future__ import annotations

from benchmarks.roofline.chart import draw_chart
from benchmarks.roofline.measure import measure_roofline
from benchmarks.roofline.report import Report

__all__ = ["Report", "draw_chart", "measure_roofline"]
