"""`python -m benchmarks hand-over`: the errors of double's kernel of one sphere, and the rule by which it hands over.

Comes in: numbers of scenes and of points, a seed. Goes out: Report: for each random scene of one sphere and one light
the largest error over hard points, in roundoffs of max(1, value), of the kernel of `double` alone, beside the bound
`run.steep.roundoffs`, and of `double`, which draws a steep part of the highlight otherwise, or hands the scene over.
Never done here: a rule.

Lights stand 1e-3 to 1e3 radii from the surface, on either side of it; eyes 0.03 to 1,000 radii; exponents are in
[1, 1000], some whole, some near where the rule turns; the sphere is on the axis, beside it, or reaches past the eye.
Points lie where the highlight is steepest, under the light, near the silhouette, and anywhere.
"""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from symrender_cg import evaluate
from symrender_cg.lower.variants import MOST_ROUNDOFFS, Variant, variant
from symrender_cg.pipeline import planned
from symrender_cg.reference import oracle
from symrender_cg.run.levels import hands_over, steep_part
from symrender_cg.run.numbers import numbers_of
from symrender_cg.run.steep import roundoffs
from symrender_cg.scene import Camera, Phong, PointLight, Scene, Sphere

UNIT = 2.0**-53
PROMISE = 1e-15
EXPONENTS = (1.0, 8.0, 32.0, 64.0, 128.0, 256.0, 1000.0)

KINDS = ("centred", "off the axis", "beside the eye")
DRAWN = ("alone", "with a box", "handed over")

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Row:
    """A scene, drawn by double's kernel alone, with a box of the image drawn otherwise, or not by it ("handed over").

    error is that of the level, alone that of the kernel, allowed its bound: in roundoffs, 2^-53, of max(1, value).
    """

    seed: int
    kind: str
    shininess: float
    distance: float
    drawn: Literal["alone", "with a box", "handed over"]
    error: float
    alone: float
    allowed: float


@dataclass(frozen=True, slots=True)
class Report:
    """What was measured."""

    points: int
    rows: tuple[Row, ...]
    alone: float

    @property
    def error(self) -> float:
        """The largest error of the level, over max(1, value)."""
        return max((row.error for row in self.rows), default=0.0) * UNIT

    @property
    def share(self) -> float:
        """The largest part that an error of the kernel takes of its bound, in scenes that it draws."""
        return max((row.alone / row.allowed for row in self.rows if row.drawn != "handed over"), default=0.0)

    def to_dict(self) -> dict[str, Any]:
        """Plain dictionaries and lists, for JSON."""
        return asdict(self) | {"error": self.error, "share": self.share}

    def show(self, console: Console) -> None:
        """One line a range of exponents, then the totals."""
        title = f"{self.points:,} points of {len(self.rows):,} random scenes of one sphere"
        table = Table(title=f"{title}; errors in 1e-15 max(1, value)")
        for head in ("exponent", "sphere", "drawn", "scenes", "error", "kernel's own", "of its bound"):
            table.add_column(head, justify="left" if head in ("sphere", "drawn") else "right")
        unit = UNIT / PROMISE
        for low, high in zip(EXPONENTS, (*EXPONENTS[1:], math.inf), strict=True):
            for kind, drawn in itertools.product(KINDS, DRAWN):
                every = (row for row in self.rows if low <= row.shininess < high)
                rows = [row for row in every if row.kind == kind and row.drawn == drawn]
                if rows:
                    error, alone = max(row.error for row in rows), max(row.alone for row in rows)
                    share = max(row.alone / row.allowed for row in rows)
                    cells = (f"{len(rows):,}", *(f"{part:.2f}" for part in (error * unit, alone * unit, share)))
                    table.add_row(f"{low:g} ..", kind, drawn, *cells)
        console.print(table)
        worst = max(self.rows, key=lambda row: row.error)
        console.print(
            f"largest error {self.error:.2e} max(1, value) (seed {worst.seed}), {100.0 * self.error / PROMISE:.0f} % "
            f"of the promise; the kernel's own errors reach {100.0 * self.share:.0f} % of their bound. In Chapter 1's "
            f"scene the kernel draws alone up to n = {self.alone:.0f}."
        )


def measure_hand_over(scenes: int, points: int, seed: int, told: Callable[[str], None]) -> Report:
    """Every scene in turn; told(text) says what is going on."""
    rows: list[Row] = []
    total = 0
    for number in range(scenes):
        if number % 50 == 0:
            told(f"scene {number} of {scenes}")
        scene = random_glossy(seed + number)
        x, y = hard_points(scene, seed + number, points)
        if x.size:
            rows.append(_row(seed + number, scene, x, y))
            total += x.size
    return Report(total, tuple(rows), largest_alone())


def _row(seed: int, scene: Scene, x: Floats, y: Floats) -> Row:
    numbers = numbers_of(planned(scene).scene)
    kind = "beside the eye" if planned(scene).needs("front_test") else "off the axis"
    center, light = scene.spheres[0].center, scene.lights[0]
    assert isinstance(light, PointLight), "random_glossy has one"
    level, kernel = errors(scene, x, y, "double", variant("double"))
    boxed = steep_part(scene) is not None
    return Row(
        seed,
        "centred" if center == (0.0, 0.0, 0.0) else kind,
        numbers["shininess"],
        abs(math.dist(light.position, center) / scene.spheres[0].radius - 1.0),
        "handed over" if hands_over(scene) else "with a box" if boxed else "alone",
        float(level.max()),
        float(kernel.max()),
        float(roundoffs(numbers)),
    )


def errors(scene: Scene, x: Floats, y: Floats, *levels: str | Variant) -> list[Floats]:
    """Errors of levels, or of kernels alone, at points: in roundoffs of max(1, value)."""
    true = oracle.evaluate(scene, x, y)
    scale = UNIT * np.maximum(1.0, np.asarray(true.value, dtype=np.float64))
    found = ((evaluate(scene, x, y, accuracy=level) - true.value) - true.residual for level in levels)
    return [np.abs(np.asarray(difference, dtype=np.float64)) / scale for difference in found]


def largest_alone(scene: Scene | None = None) -> float:
    """The largest exponent that the kernel of `double` draws alone, to 1/8, in a scene, or in Chapter 1's."""
    numbers = dict(numbers_of(planned(scene or Scene.chapter1()).scene))
    low, high = 1.0, 1e6
    while high - low > 0.125:
        middle = 0.5 * (low + high)
        keeps = roundoffs(numbers | {"shininess": middle}) <= MOST_ROUNDOFFS
        low, high = (middle, high) if keeps else (low, middle)
    return low


def random_glossy(seed: int) -> Scene:
    """One sphere, one light; half of the scenes have an exponent near the one up to which the kernel draws alone."""
    draw = random.Random(seed)
    radius = draw.uniform(0.5, 2.0)
    eye = radius * (1.0 + 10.0 ** draw.uniform(-1.5, 3.0))
    distance = 10.0 ** draw.choice((draw.uniform(-3.0, 3.0), draw.uniform(-0.5, 2.0)))
    away = radius * (1.0 - distance if distance < 0.9 and draw.random() < 0.15 else 1.0 + distance)
    way = (draw.gauss(0.0, 1.0), draw.gauss(0.0, 1.0), abs(draw.gauss(0.0, 1.0)) * draw.choice((1.0, 3.0)))
    length = math.hypot(*way)
    where = draw.random()
    center = (0.0, 0.0, 0.0)
    if where < 0.35:
        center = (draw.uniform(-0.5, 0.5), draw.uniform(-0.5, 0.5), draw.uniform(-0.5, 0.0))
    elif where < 0.42:
        eye = max(eye, 2.0 * radius)
        turn = draw.uniform(0.0, 2.0 * math.pi)
        aside = radius * draw.uniform(1.1, 3.0)
        center = (aside * math.cos(turn), aside * math.sin(turn), eye - radius * draw.uniform(0.0, 0.95))
    x, y, z = (c + away * part / length for c, part in zip(center, way, strict=True))
    ambient, diffuse = draw.choice((0.0, 0.1)), draw.choice((0.0, 0.3, 0.7, 0.7, 1.0))
    specular = draw.choice((0.1, 0.3, 0.5, 0.5, 1.0, draw.uniform(0.0, 1.0)))
    intensity = draw.choice((1.0, 1.0, draw.uniform(0.1, 2.0), draw.uniform(0.1, 8.0)))
    n = draw.choice((10.0 ** draw.uniform(0.0, 3.0), float(draw.randint(1, 1000)), float(2 * draw.randint(1, 200))))

    def made(exponent: float) -> Scene:
        material = Phong(ambient, diffuse, specular, exponent)
        camera = Camera((0.0, 0.0, eye), half_height=eye if where < 0.42 and center[2] > 0.0 else None)
        return Scene(camera, (Sphere(center, radius, material),), (PointLight((x, y, z), intensity),))

    if draw.random() < 0.5:
        turns = min(largest_alone(made(1.0)), 1000.0)
        n = max(1.0, turns * draw.uniform(0.7, 1.0))
        n = 2.0 * max(1.0, n // 2.0) if draw.random() < 0.3 else n
    return made(n)


def hard_points(scene: Scene, seed: int, count: int) -> tuple[Floats, Floats]:
    """At most `count` points of the image plane on the sphere: seven in ten where the highlight is steepest."""
    frame = planned(scene).scene
    sphere, light = frame.spheres[0], frame.lights[0]
    assert isinstance(light, PointLight), "random_glossy has one"
    eye, radius, center = np.array(frame.camera.eye), sphere.radius, np.array(sphere.center)
    to_light, to_eye = np.array(light.position) - center, eye - center
    below, ahead = _unit(to_light), _unit(to_eye)
    middle = _unit(below + ahead)
    for _ in range(60):
        half = _unit(_unit(to_light - radius * middle) + _unit(to_eye - radius * middle))
        middle = _unit(middle + 0.7 * (half - middle))
    near = radius / np.linalg.norm(to_light - radius * middle) + radius / np.linalg.norm(to_eye - radius * middle)
    width = 1.0 / (math.sqrt(sphere.material.shininess) * (2.0 + near))
    rim = radius / float(np.linalg.norm(to_eye))

    draw = np.random.default_rng(seed)
    chance, ways = draw.random((4 * count, 1)), draw.normal(size=(4 * count, 3))
    aside = _unit(ways - (ways @ ahead)[:, np.newaxis] * ahead)
    height = np.minimum(1.0, rim + 10.0 ** draw.uniform(-12.0, -1.0, chance.shape))
    kinds = (
        (chance < 0.7, middle + width * 10.0 ** draw.uniform(-0.7, 0.4, chance.shape) * ways),
        (chance < 0.8, below + 10.0 ** draw.uniform(-4.0, -0.5, chance.shape) * ways),
        (chance < 0.87, height * ahead + np.sqrt(1.0 - height * height) * aside),
    )
    n = _unit(np.select([kind for kind, _ in kinds], [way for _, way in kinds], ways))
    p = center + radius * n
    seen = (p[:, 2] < eye[2]) & (((eye - p) * n).sum(axis=1) > 0.0)
    p = p[seen][:count]
    scale = eye[2] / (eye[2] - p[:, 2])
    return np.ascontiguousarray(p[:, 0] * scale), np.ascontiguousarray(p[:, 1] * scale)


def _unit(vectors: Floats) -> Floats:
    """Each row, or the vector, divided by its length; a vector of zeros as it is."""
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    found: Floats = vectors / np.where(lengths > 0.0, lengths, 1.0)
    return found
