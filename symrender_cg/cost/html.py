"""A report as one HTML file that needs nothing else: chart, tables, and of every way its error, its C, its derivation.

Comes in: a Scene, what was measured, a file name. Goes out: the file. Never done here: a measurement, but for the error
images, whose truth are enclosures (a ball of about 1e-28 around every value).

The differences of a way are those to the next more accurate one: of the kernels' programs, step by step, where both are
of one sphere, else of the C.
"""

from __future__ import annotations

import base64
import difflib
import io
from pathlib import Path
from typing import Any, Final

import jinja2
import numpy as np
from numpy.typing import NDArray

from symrender_cg.cost.chart import picture
from symrender_cg.cost.measure import Measured
from symrender_cg.cost.ready import Ready, subsamples
from symrender_cg.cost.report import Entry
from symrender_cg.cost.sample import LOWEST_BIN
from symrender_cg.output import replacing
from symrender_cg.pipeline import pixel_size
from symrender_cg.resources import template_path
from symrender_cg.run.enclosure import enclose
from symrender_cg.run.grid import pixel_centres
from symrender_cg.scene import Scene

Floats = NDArray[np.float64]

TEMPLATE: Final = "cost.html.j2"
SIDE: Final = 128
"""Rows of an error image."""
LEAST, MOST = 1e-17, 1e-1
"""Ends of the scale of the error images, white and black; a larger error is red."""
LINES: Final = 400
"""Lines of differences that are shown."""


def write_html(path: str | Path, scene: Scene, measured: Measured) -> None:
    """Writes the file whole or not at all. Raises ArgumentError without matplotlib or for an unwritable place."""
    text = html(scene, measured)
    with replacing(Path(path)) as file:
        file.write(text.encode())


def html(scene: Scene, measured: Measured) -> str:
    """The text of the file."""
    report = measured.report
    by_name = {one.way.name: one for one in measured.ready}
    order = sorted(report.entries, key=lambda entry: (not entry.on_front, entry.ns.median))
    chart = picture(report, "svg").decode()
    images = _Images(scene, report.width / report.height)
    accurate = sorted(report.front, key=lambda entry: -entry.errors.largest)
    ways = []
    for entry in order:
        one = by_name[entry.name]
        after = _next(entry, accurate)
        ways.append(
            {
                "entry": entry,
                "image": images.of(one),
                "bars": _bars(entry.errors.histogram),
                "code": _code(one),
                "steps": one.steps,
                "next": after.name if after is not None else "",
                "differences": "" if after is None else _differences(one, by_name[after.name]),
            }
        )
    environment = jinja2.Environment(
        undefined=jinja2.StrictUndefined, autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    template = environment.from_string(template_path(TEMPLATE).read_text(encoding="utf-8"))
    return template.render(
        report=report,
        title=Path(report.scene).stem,
        chart=chart[chart.index("<svg") :],
        ways=ways,
        least=LEAST,
        most=MOST,
        lines=LINES,
    )


def _next(entry: Entry, accurate: list[Entry]) -> Entry | None:
    """The next way of the front that is more accurate; of a dominated way the one that dominates it."""
    if entry.dominated_by:
        return next((other for other in accurate if other.name == entry.dominated_by), None)
    return next((other for other in accurate if other.errors.largest < entry.errors.largest), None)


def _code(one: Ready) -> str:
    return next((text for name, text in one.files.items() if name.endswith(".c")), "")


def _differences(one: Ready, other: Ready) -> str:
    """Unified differences, at most LINES lines."""
    pair = (one.steps, other.steps) if one.steps and other.steps else (_code(one), _code(other))
    if not all(pair):
        return ""
    before, after = (text.splitlines() for text in pair)
    lines = list(difflib.unified_diff(before, after, one.way.name, other.way.name, lineterm="", n=1))
    return "\n".join(lines[:LINES])


class _Images:
    """Error images of one scene; the truth at the pixels is enclosed once."""

    def __init__(self, scene: Scene, aspect: float) -> None:
        self.scene = scene
        self.size = (max(1, round(SIDE * aspect)), SIDE)
        frame = scene.in_camera_frame()
        columns, rows = pixel_centres(*self.size, pixel_size(frame, SIDE))
        self.x, self.y = (np.ravel(part) for part in np.meshgrid(columns, rows))
        self._true: dict[int, tuple[Floats, Floats]] = {}

    def truth(self, side: int) -> tuple[Floats, Floats]:
        """hi and lo of the values at the pixels' centres, or of the mean of side x side places of each."""
        if side not in self._true:
            offsets = subsamples(self.scene, self.size, side) if side > 1 else [(0.0, 0.0)]
            found = [enclose(self.scene, self.x + dx, self.y + dy) for dx, dy in offsets]
            hi: Floats = np.mean([one.hi for one in found], axis=0)
            self._true[side] = hi, np.mean([(one.hi - hi) + one.lo for one in found], axis=0)
        return self._true[side]

    def of(self, one: Ready) -> str:
        """A PNG of |error| as a data URI: white LEAST, black MOST, on a log scale; red beyond."""
        hi, lo = self.truth(one.way.side)
        values = one.field(self.x, self.y) if one.way.side == 1 else self._averaged(one)
        values = values.reshape(values.shape[0], -1)
        hi, lo = hi.reshape(values.shape[0], -1), lo.reshape(values.shape[0], -1)
        grey = values.dtype == np.uint8
        wide = values / 255.0 if grey else values.astype(np.float64)
        true = np.clip(hi, 0.0, 1.0) if grey else hi
        with np.errstate(invalid="ignore"):
            error = np.abs((wide - true) - (0.0 if grey else lo)).max(axis=1)
        return _data_uri(shades(error).reshape(self.size[1], self.size[0], 3))

    def _averaged(self, one: Ready) -> NDArray[Any]:
        """The field of supersampling about the pixels of this image: its own has other pixels."""
        from symrender_cg.cost.ready import field_of

        return field_of(one.way, self.scene, self.size)(self.x, self.y)


def shades(error: Floats) -> NDArray[np.uint8]:
    """RGB of absolute errors: 255 at LEAST and below, 0 at MOST, red beyond it and where there is no number."""
    span = np.log10(MOST) - np.log10(LEAST)
    share = (np.log10(np.clip(error, LEAST, MOST)) - np.log10(LEAST)) / span
    level = np.where(np.isfinite(share), 255.0 * (1.0 - share), 0.0).astype(np.uint8)
    colours = np.repeat(level[:, np.newaxis], 3, axis=1)
    colours[~(error <= MOST)] = (214, 39, 40)
    return colours


def _data_uri(pixels: NDArray[np.uint8]) -> str:
    from PIL import Image

    held = io.BytesIO()
    Image.fromarray(pixels, "RGB").save(held, "PNG", optimize=True)
    return "data:image/png;base64," + base64.b64encode(held.getvalue()).decode()


def _bars(histogram: tuple[int, ...]) -> list[dict[str, Any]]:
    """What the template draws of a histogram: share of the tallest bar, words."""
    top = max(histogram, default=0)
    words = ["0", *(f"up to 2^{power}" for power in range(LOWEST_BIN, LOWEST_BIN + len(histogram) - 1))]
    return [
        {"height": round(40.0 * count / top, 1) if top else 0.0, "words": f"{word} ulp: {count:,} points"}
        for word, count in zip(words, histogram, strict=True)
    ]
