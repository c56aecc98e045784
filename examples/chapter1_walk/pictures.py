"""The pictures of the Chapter 1 walk: arrays and numbers in, PNG files out. Never done here: a measurement.

Needs matplotlib (drawn by Agg, so no display). Without it `Gallery` says so once and draws nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
RED, BLUE, GREY, MAGENTA = "#d62728", "#1f77b4", "#7f7f7f", (1.0, 0.0, 0.8)


@dataclass(frozen=True, slots=True)
class Gallery:
    """A folder of pictures, `cell1.png` to `cell8.png`; half is the image plane's half-extent, for the axes."""

    folder: Path
    half: float

    @property
    def missing(self) -> str | None:
        """What is needed to draw, if it is not there."""
        return None if find_spec("matplotlib") else "no pictures: matplotlib is not installed (pip install matplotlib)"

    def baseline(self, image: FloatArray) -> None:
        """Cell 1: the per-pixel image."""
        if figure := self._figure(4.2, 4.4):
            self._image(figure.add_subplot(), image, "per pixel (Cell 1)")
            self._save(figure, 1)

    def swell(self, seed: Mapping[str, int], named: int) -> None:
        """Cell 2: operations of the seed's expressions as they stand, beside all of the named definitions together."""
        if figure := self._figure(6.4, 3.2):
            axes = figure.add_subplot()
            names = [*seed, "all definitions,\neach once"]
            counts = [*seed.values(), named]
            bars = axes.barh(names, counts, color=[GREY] * len(seed) + [RED])
            axes.bar_label(bars, [f"{count:,}" for count in counts], padding=3, fontsize=8)
            axes.invert_yaxis()
            axes.set_xlim(0, 1.12 * max(counts))
            axes.set_xlabel("operations (sympy's count)")
            axes.set_title("one swollen expression, or named definitions", fontsize=10)
            axes.spines[["top", "right"]].set_visible(False)
            self._save(figure, 2)

    def difference(self, per_pixel: FloatArray, panels: Sequence[tuple[str, FloatArray]], floor: float) -> None:
        """Cell 3: the compiled image, then absolute differences on one logarithmic scale that starts at `floor`."""
        if figure := self._figure(3.6 * (1 + len(panels)) + 0.8, 3.9):
            from matplotlib.colors import LogNorm

            axes = figure.subplots(1, 1 + len(panels))
            self._image(axes[0], per_pixel, "the image")
            norm = LogNorm(floor, max(float(values.max()) for _, values in panels))
            shown = None
            for place, (title, values) in zip(axes[1:], panels, strict=True):
                shown = place.imshow(np.maximum(values, floor), cmap="magma", norm=norm, extent=self._extent)
                place.set_title(f"{title}\nlargest {values.max():.1e}", fontsize=9)
                place.axis("off")
            figure.colorbar(shown, ax=axes[1:].tolist(), shrink=0.8, label="absolute difference")
            self._save(figure, 3)

    def timings(self, sizes: Sequence[int], rows: Mapping[str, Sequence[float | None]]) -> None:
        """Cell 4: nanoseconds a pixel over the side of the image, one line a way to compute it."""
        if figure := self._figure(6.0, 4.0):
            axes = figure.add_subplot()
            for name, values in rows.items():
                known = [(size, value) for size, value in zip(sizes, values, strict=True) if value is not None]
                axes.loglog([s for s, _ in known], [v for _, v in known], marker="o", markersize=4, label=name)
            axes.set_xticks(sizes, [f"{size}\u00b2" for size in sizes])
            axes.minorticks_off()
            axes.set_ylabel("ns a pixel, one thread")
            axes.grid(axis="y", alpha=0.3)
            axes.spines[["top", "right"]].set_visible(False)
            figure.legend(*axes.get_legend_handles_labels(), loc="outside right center", fontsize=8, frameon=False)
            self._save(figure, 4)

    def silhouette(self, image: FloatArray, rho: float) -> None:
        """Cell 5: the exact circle over the pixels, whole and enlarged at its upper right."""
        if figure := self._figure(8.2, 4.2):
            from matplotlib.patches import Circle, Rectangle

            whole, near = figure.subplots(1, 2)
            for axes in (whole, near):
                axes.imshow(image, cmap="gray", vmin=0, vmax=1, extent=self._extent, interpolation="nearest")
                axes.add_patch(Circle((0, 0), rho, color=RED, fill=False, lw=1.2))
            side = 16 * 2 * self.half / image.shape[0]
            left = bottom = rho * np.sqrt(0.5) - side / 2
            whole.add_patch(Rectangle((left, bottom), side, side, fill=False, ec=BLUE, lw=1))
            near.set(xlim=(left, left + side), ylim=(bottom, bottom + side))
            whole.set_title(rf"$x^2+y^2=\rho^2$, $\rho$ = {rho!r}", fontsize=9)
            near.set_title("16 by 16 pixels of it", fontsize=9)
            for axes in (whole, near):
                axes.tick_params(labelsize=7)
            self._save(figure, 5)

    def derivative(self, slope: FloatArray, unclamped: FloatArray) -> None:
        """Cell 6: dI/dl_x of the image, and of the field without its clamps; one symmetric scale."""
        if figure := self._figure(8.6, 3.9):
            axes = figure.subplots(1, 2)
            largest = float(np.abs(slope).max())
            shown = None
            titles = ("dI/dl_x of the image (clamps and all)", "the seed's: the field without clamps")
            for place, values, title in zip(axes, (slope, unclamped), titles, strict=True):
                shown = place.imshow(values, cmap="RdBu", vmin=-largest, vmax=largest, extent=self._extent)
                place.set_title(title, fontsize=9)
                place.axis("off")
            figure.colorbar(shown, ax=axes.tolist(), shrink=0.85)
            self._save(figure, 6)

    def heaviside(self, raw: FloatArray, regularised: FloatArray, piecewise: FloatArray) -> None:
        """Cell 7: H(disc) times the shading, raw (nan in magenta) and regularised, and the Piecewise image."""
        if figure := self._figure(10.4, 3.9):
            axes = figure.subplots(1, 3)
            count = int(np.isnan(raw).sum())
            titles = (f"H(disc) I: {count:,} nan", "regularised: none", "Piecewise")
            for place, values, title in zip(axes, (raw, regularised, piecewise), titles, strict=True):
                self._image(place, values, title)
            self._save(figure, 7)

    def two_spheres(self, rows: Sequence[tuple[str, FloatArray, NDArray[np.bool_], NDArray[np.bool_]]]) -> None:
        """Cell 8: each case as it is, and in magenta the pixels that a condition gives to the wrong sphere.

        rows: title, true image, where the naive condition is wrong, where front-to-back order is wrong
        """
        if figure := self._figure(2.5 * len(rows) + 0.4, 7.9):
            axes = figure.subplots(3, len(rows))
            for column, (title, image, naive, ordered) in enumerate(rows):
                self._image(axes[0, column], image, title)
                for place, wrong in ((axes[1, column], naive), (axes[2, column], ordered)):
                    shown = np.repeat(np.clip(image, 0, 1)[..., np.newaxis], 3, axis=2)
                    shown[wrong] = MAGENTA
                    place.imshow(shown, extent=self._extent, interpolation="nearest")
                    place.set_title(f"{int(wrong.sum()):,} pixels wrong", fontsize=8)
                    place.set_xticks([])
                    place.set_yticks([])
            axes[1, 0].set_ylabel("Cell 8's condition", fontsize=9)
            axes[2, 0].set_ylabel("sorted by power of the eye", fontsize=9)
            self._save(figure, 8)

    @property
    def _extent(self) -> tuple[float, float, float, float]:
        return (-self.half, self.half, -self.half, self.half)

    def _figure(self, width: float, height: float) -> Any:
        if self.missing:
            return None
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=(width, height), layout="constrained", dpi=130)
        FigureCanvasAgg(figure)
        return figure

    def _image(self, axes: Any, image: FloatArray, title: str) -> None:
        from matplotlib import colormaps

        grey = colormaps["gray"].with_extremes(bad=MAGENTA)
        axes.imshow(np.ma.masked_invalid(image), cmap=grey, vmin=0, vmax=1, extent=self._extent)
        axes.set_title(title, fontsize=9)
        axes.axis("off")

    def _save(self, figure: Any, cell: int) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        figure.savefig(self.folder / f"cell{cell}.png", metadata={"Software": None})
