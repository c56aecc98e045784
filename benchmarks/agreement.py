"""`python -m benchmarks agreement`: our pictures beside those of two renderers that nobody here wrote.

Comes in: names of scenes, a size, rounds. Goes out: Report and its tables; with `out`, pictures: ours, the peer's, and
100 times their difference. Never done here: the peers' scene files (povray_text.py, mitsuba.py).

POV-Ray draws the same image: Phong, shadows, mirrors, checker, gradient. Compared unclipped, in 8-bit levels (1/255);
POV-Ray's numbers come in steps of 16 bits over the gain that keeps them below 1. Mitsuba answers what each pixel's ray
meets: index, depth, normal.

A pixel that differs is *at an edge* when the reference, brute force, takes the peer's value within EDGE of a pixel
from the centre: two renderers may round a silhouette, a shadow or a tile to either side there. Where it does not, the
rigorous oracle is asked who is right.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from benchmarks import mitsuba, povray, povray_text
from benchmarks.machine import Machine, Spread, cores, spread, take_turns, this_machine, warm_sample
from benchmarks.strips import save_strip
from symrender_cg import Scene, render_image, render_layers
from symrender_cg.errors import OutsidePlanError
from symrender_cg.reference import brute_force, oracle
from symrender_cg.scene import Phong, PointLight, load_scene

Floats = NDArray[np.float64]

LEVEL: Final = 1.0 / 255.0
EDGE: Final = 0.01
ASKED: Final = 100
"""The most pixels of a scene that the oracle is asked about."""


@dataclass(frozen=True, slots=True)
class ImageAgreement:
    """Ours against POV-Ray's; differences in 8-bit levels, of the worst channel.

    over: pixels more than a level apart; at_edges: how many of those are; the others: asked of the oracle, and
    ours_right, how often our value was within a level of it and POV-Ray's was not.
    within: the largest difference of all other pixels, in POV-Ray's own steps.
    """

    largest: float
    q999: float
    mean: float
    over: int
    at_edges: int
    asked: int
    ours_right: int
    within: float
    step: float
    pictures: int
    trace_ms: Spread


@dataclass(frozen=True, slots=True)
class GeometryAgreement:
    """Ours against Mitsuba: pixels with another index, those at edges, and of the others depth and normal."""

    silhouettes: int
    index_differs: int
    at_edges: int
    depth_largest: float
    depth_q999: float
    normal_largest: float
    normal_q999: float
    intersect_ms: Spread


@dataclass(frozen=True, slots=True)
class SceneReport:
    """One scene; `drawn_by`: the kernel, or the reference where no kernel draws the scene."""

    name: str
    drawn_by: str
    notes: tuple[str, ...]
    ours_ms: Spread
    image: ImageAgreement | None
    geometry: GeometryAgreement | None


@dataclass(frozen=True, slots=True)
class Report:
    """What `agreement` measured."""

    machine: Machine
    peers: tuple[str, ...]
    missing: tuple[str, ...]
    size: int
    rounds: int
    threads: int
    scenes: tuple[SceneReport, ...]

    def to_dict(self) -> dict[str, Any]:
        """Plain dictionaries and lists, for JSON."""
        return asdict(self)

    def show(self, console: Console) -> None:
        """A table for each peer, and the notes."""
        console.print(self.machine.line(), highlight=False)
        for line in (*self.peers, *self.missing):
            console.print(line, highlight=False)
        if any(scene.image for scene in self.scenes):
            console.print(self._image_table())
            console.print(
                "Differences of the unclipped image in 8-bit levels; 'rest': the largest of the pixels within a level, "
                "in POV-Ray's own steps (half a step is its rounding). 'oracle': pixels off the edges that it was "
                "asked about, and how often ours was right and POV-Ray's was not."
            )
        if any(scene.geometry for scene in self.scenes):
            console.print(self._geometry_table())
            console.print(
                "Depth relative, normals absolute, both where the indices agree; Mitsuba works in float32. "
                "Silhouettes: pixels beside one with another index."
            )
        for scene in self.scenes:
            for note in scene.notes:
                console.print(f"{scene.name}: {note}", highlight=False)

    def _table(self, title: str, heads: Sequence[str]) -> Table:
        table = Table(title=f"{title}, {self.size} x {self.size}, {self.threads} threads, {self.rounds} rounds")
        table.add_column("scene")
        for head in heads:
            table.add_column(head, justify="right")
        return table

    def _image_table(self) -> Table:
        heads = ("largest", "99.9 %", "mean", "> 1 level", "at edges", "oracle", "rest", "ours ms", "POV-Ray ms")
        table = self._table("image, against POV-Ray", heads)
        for scene in self.scenes:
            if (a := scene.image) is not None:
                table.add_row(
                    scene.name,
                    f"{a.largest:.3g}",
                    f"{a.q999:.2g}",
                    f"{a.mean:.2g}",
                    f"{a.over:,}",
                    f"{a.at_edges:,}",
                    f"{a.ours_right} of {a.asked}" if a.asked else "-",
                    f"{a.within:.2f}",
                    f"{scene.ours_ms.median:.2f}" + ("" if scene.drawn_by == "kernel" else " (reference)"),
                    f"{a.trace_ms.median:.0f}" + (f" x {a.pictures}" if a.pictures > 1 else ""),
                )
        return table

    def _geometry_table(self) -> Table:
        heads = (
            "silhouettes",
            "other index",
            "at edges",
            "depth, largest",
            "99.9 %",
            "normal, largest",
            "99.9 %",
            "ms",
        )
        table = self._table("index, depth, normal, against Mitsuba", heads)
        for scene in self.scenes:
            if (g := scene.geometry) is not None:
                table.add_row(
                    scene.name,
                    f"{g.silhouettes:,}",
                    f"{g.index_differs:,}",
                    f"{g.at_edges:,}",
                    f"{g.depth_largest:.1e}",
                    f"{g.depth_q999:.1e}",
                    f"{g.normal_largest:.1e}",
                    f"{g.normal_q999:.1e}",
                    f"{g.intersect_ms.median:.2f}",
                )
        return table


def measure_agreement(
    names: Sequence[str], size: int, rounds: int, seed: int, out: Path | None, told: Callable[[str], None]
) -> Report:
    """Every scene against every peer that is installed; without names, all built-in scenes."""
    program, lacking = povray.find(), mitsuba.missing()
    absent = [] if program else [f"POV-Ray is not installed and left out; {povray.INSTALL}"]
    absent += [lacking] if lacking else []
    peers = ([povray.version(program)] if program else []) + ([] if lacking else [mitsuba.version()])
    scenes = []
    for name in names or Scene.builtin_names():
        one = _One(name, size, cores(), out)
        told(f"{name}: ours")
        scenes.append(one.measure(program, not lacking, rounds, seed, told))
    return Report(this_machine(), tuple(peers), tuple(absent), size, rounds, cores(), tuple(scenes))


def statable(scene: Scene) -> tuple[Scene, list[str]]:
    """The nearest scene that POV-Ray can state: gates on, some attenuations without b; and what was changed."""
    notes = list(povray_text.departures(scene))

    def gated(material: Phong) -> Phong:
        return replace(material, gate_specular=True)

    lights = list(scene.lights)
    for number, light in enumerate(lights):
        if isinstance(light, PointLight):
            try:
                povray_text.fades(light.attenuation)
            except povray_text.NotStatedError:
                a, _, c = light.attenuation
                lights[number] = replace(light, attenuation=(a, 0.0, c))
                notes.append(f"lights[{number}] has attenuation {light.attenuation}, drawn here as {(a, 0.0, c)}")
    plane = scene.plane
    if plane is not None:
        checker = None if plane.checker is None else gated(plane.checker)
        plane = replace(plane, material=gated(plane.material), checker=checker)
    spheres = tuple(replace(sphere, material=gated(sphere.material)) for sphere in scene.spheres)
    return replace(scene, spheres=spheres, lights=tuple(lights), plane=plane), notes


class _One:
    """One scene: drawn by us once, then compared."""

    def __init__(self, name: str, size: int, threads: int, out: Path | None) -> None:
        self.name, self.size, self.threads, self.out = Path(name).stem, size, threads, out
        self.scene, notes = statable(load_scene(name))
        self.notes = notes
        self.frame = self.scene.in_camera_frame()
        self.drawn_by = "kernel"
        try:
            self.image = np.asarray(render_image(self.scene, size, size, clip=False, threads=threads))
            layers = render_layers(self.scene, size, size, layers=("depth", "normal", "index"), threads=threads)
            self.depth, self.normal, self.index = layers["depth"], layers["normal"], layers["index"]
        except OutsidePlanError as reason:
            self.drawn_by = "reference"
            self.notes.append(f"drawn by the reference, since no kernel does: {reason}")
            traced = brute_force.image(self.frame, size, size)
            self.image, self.depth, self.normal, self.index = traced.value, traced.depth, traced.normal, traced.index
        half = self.frame.camera.half_height
        assert half is not None, "a camera-frame scene has its half_height"
        self.pixel = 2.0 * half / size

    def measure(
        self, program: str | None, with_mitsuba: bool, rounds: int, seed: int, told: Callable[[str], None]
    ) -> SceneReport:
        """Times in turns; agreement of the first pictures."""
        told(f"{self.name}: peers")
        gain = 2.0 ** -max(0, int(np.ceil(np.log2(max(float(self.image.max()), 1.0)))))
        calls: dict[str, Callable[[], float]] = {"ours": warm_sample(self._draw)}
        drawn = (
            povray.draw(program, self.scene, self.size, self.size, threads=self.threads, gain=gain) if program else None
        )
        if program:
            chosen = program

            def trace() -> float:
                return (
                    1e3
                    * povray.draw(
                        chosen, self.scene, self.size, self.size, threads=self.threads, gain=gain
                    ).trace_seconds
                )

            calls["POV-Ray"] = trace
        samples = take_turns(calls, rounds, seed, lambda number: told(f"{self.name}: round {number + 1} of {rounds}"))
        found = mitsuba.layers(self.scene, self.size, self.size, threads=self.threads) if with_mitsuba else None
        image = None if drawn is None else self._against_povray(drawn, spread(samples["POV-Ray"]))
        geometry = None if found is None else self._against_mitsuba(found)
        ours_ms = spread(samples["ours"])
        return SceneReport(self.name, self.drawn_by, tuple(self.notes), ours_ms, image, geometry)

    def _draw(self) -> None:
        """An image into the array that there is, or one of the reference."""
        if self.drawn_by == "kernel":
            render_image(self.scene, self.size, self.size, clip=False, threads=self.threads, out=self.image)
        else:
            brute_force.image(self.frame, self.size, self.size)

    def _against_povray(self, drawn: povray.Drawn, trace_ms: Spread) -> ImageAgreement:
        apart = np.abs(self.image - drawn.image)
        apart = apart if apart.ndim == 2 else apart.max(axis=-1)
        rows, columns = np.nonzero(apart > LEVEL)
        theirs, ours = (self._channels(a[rows, columns]) for a in (drawn.image, self.image))
        around = self._channels(self._around(rows, columns).value)
        low, high = around.min(axis=0) - LEVEL, around.max(axis=0) + LEVEL
        at_edge = ((theirs >= low) & (theirs <= high)).all(axis=-1)
        off = np.flatnonzero(~at_edge)[:: max(1, int((~at_edge).sum()) // ASKED)][:ASKED]
        right = 0
        if off.size:
            truth = self._channels(oracle.evaluate(self.frame, *self._points(rows[off], columns[off])).value)
            good, bad = (np.abs(v[off] - truth).max(axis=-1) <= LEVEL for v in (ours, theirs))
            right = int((good & ~bad).sum())
        if self.out is not None:
            save_strip(self.out / f"{self.name}-povray.png", self.image, drawn.image)
        return ImageAgreement(
            largest=float(apart.max() / LEVEL),
            q999=float(np.quantile(apart, 0.999) / LEVEL),
            mean=float(apart.mean() / LEVEL),
            over=rows.size,
            at_edges=int(at_edge.sum()),
            asked=int(off.size),
            ours_right=right,
            within=float(apart[apart <= LEVEL].max(initial=0.0) / drawn.level),
            step=drawn.level,
            pictures=drawn.pictures,
            trace_ms=trace_ms,
        )

    def _against_mitsuba(self, found: mitsuba.Layers) -> GeometryAgreement:
        index = self.index
        rows, columns = np.nonzero(index != found.index)
        around = self._around(rows, columns).index
        same = (index == found.index) & (index >= 0)
        depth = np.abs(found.depth[same] / self.depth[same] - 1.0)
        normal = np.abs(found.normal - self.normal).max(axis=-1)[same]
        beside = np.zeros(index.shape, dtype=bool)
        beside[:, 1:] |= index[:, 1:] != index[:, :-1]
        beside[1:] |= index[1:] != index[:-1]
        if self.out is not None:
            ours, theirs = (np.where(n != 0.0, 0.5 + 0.5 * n, 0.0) for n in (self.normal, found.normal))
            save_strip(self.out / f"{self.name}-mitsuba-normals.png", ours, theirs)
        return GeometryAgreement(
            silhouettes=int(beside.sum()),
            index_differs=rows.size,
            at_edges=int((around == found.index[rows, columns]).any(axis=0).sum()),
            depth_largest=float(depth.max(initial=0.0)),
            depth_q999=float(np.quantile(depth, 0.999)) if depth.size else 0.0,
            normal_largest=float(normal.max(initial=0.0)),
            normal_q999=float(np.quantile(normal, 0.999)) if normal.size else 0.0,
            intersect_ms=found.milliseconds,
        )

    def _channels(self, values: Floats) -> Floats:
        """With a last axis for the channels, also where there is one."""
        return values if self.scene.channels == 3 else values[..., np.newaxis]

    def _points(self, rows: NDArray[np.int64], columns: NDArray[np.int64]) -> tuple[Floats, Floats]:
        pixel = np.float64(self.pixel)
        x, y = (columns + 0.5 - 0.5 * self.size) * pixel, (0.5 * self.size - 0.5 - rows) * pixel
        return x.astype(np.float64), y.astype(np.float64)

    def _around(self, rows: NDArray[np.int64], columns: NDArray[np.int64]) -> brute_force.Traced:
        """The reference at 9 points within EDGE of each pixel's centre: (9, pixels)."""
        x, y = self._points(rows, columns)
        aside = EDGE * self.pixel * np.array([-1.0, 0.0, 1.0])
        dx, dy = (d.reshape(9, 1) for d in np.meshgrid(aside, aside))
        return brute_force.trace(self.frame, x + dx, y + dy)
