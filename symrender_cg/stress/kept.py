"""The kept list of worst points: what a run found worst, as a file that a later run and a test read back bit for bit.

Comes in: rows of a Report, or a file. Goes out: a JSON file whose floats are hexadecimal, or Kept points. Never done
here: a measurement.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from msgspec import Struct, structs

from symrender_cg.errors import ArgumentError
from symrender_cg.scene import Camera, DirectionalLight, Gradient, Phong, Plane, PointLight, Scene, Sphere
from symrender_cg.stress.run import Report

_KINDS: Final[dict[str, type[Struct]]] = {
    kind.__name__: kind for kind in (Camera, DirectionalLight, Gradient, Phong, Plane, PointLight, Scene, Sphere)
}
_MEANING: Final = (
    "the worst point of each family at each level when it was found; floats are hexadecimal; "
    "python -m symrender_cg stress --keep FILE adds what it finds and keeps the worse of two"
)


@dataclass(frozen=True, slots=True)
class Kept:
    """A point of a scene that was the worst of its family at a level, with what was wrong there when it was found."""

    family: str
    level: str
    scene: Scene
    x: float
    y: float
    note: str
    ulp: float
    error: float
    flipped: bool

    @property
    def badness(self) -> tuple[bool, float, float]:
        """Larger is worse."""
        return self.flipped, self.ulp, self.error


def worst_points(report: Report) -> tuple[Kept, ...]:
    """The worst point of each row that has an error at all."""
    found = []
    for row in report.rows:
        case, outcome = row.worst, row.worst_outcome
        if case is None or outcome is None or case.scene is None or case.refused or outcome.non_finite:
            continue
        flipped = outcome.hit_flip or outcome.zero_flip
        if flipped or outcome.error > 0.0:
            found.append(
                Kept(row.family, row.level, case.scene, case.x, case.y, case.note, outcome.ulp, outcome.error, flipped)
            )
    return tuple(found)


def keep(path: str | Path, found: Iterable[Kept]) -> int:
    """Adds points to a file, the worse of two of one family and level; returns how many are new there."""
    file = Path(path)
    before = read_kept(file) if file.exists() else ()
    kept = {(point.family, point.level): point for point in before}
    new = 0
    for point in found:
        key = (point.family, point.level)
        if key not in kept or kept[key].badness < point.badness:
            kept[key] = point
            new += 1
    data = {"meaning": _MEANING, "points": [_as_data(kept[key]) for key in sorted(kept)]}
    try:
        file.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    except OSError as failure:
        raise ArgumentError(
            f"--keep: {file} cannot be written ({failure.strerror}); expected a file in a folder that exists"
        ) from None
    return new


def read_kept(path: str | Path) -> tuple[Kept, ...]:
    """The points of a file. Raises ArgumentError where it is not one of these."""
    try:
        data = json.loads(Path(path).read_text(encoding="utf-8"))
        return tuple(_point(entry) for entry in data["points"])
    except (OSError, ValueError, KeyError, TypeError) as failure:
        raise ArgumentError(
            f"{path}: not a list of kept points ({type(failure).__name__}: {failure}); expected a file that "
            "`stress --keep` wrote"
        ) from None


def _as_data(point: Kept) -> dict[str, Any]:
    return {
        "family": point.family,
        "level": point.level,
        "note": point.note,
        "ulp": point.ulp,
        "error": point.error,
        "flipped": point.flipped,
        "x": point.x.hex(),
        "y": point.y.hex(),
        "scene": _encoded(point.scene),
    }


def _point(entry: dict[str, Any]) -> Kept:
    scene = _decoded(entry["scene"])
    if not isinstance(scene, Scene):
        raise TypeError(f"a {type(scene).__name__} where a Scene should be")
    return Kept(
        family=entry["family"],
        level=entry["level"],
        scene=scene,
        x=float.fromhex(entry["x"]),
        y=float.fromhex(entry["y"]),
        note=entry["note"],
        ulp=float(entry["ulp"]),
        error=float(entry["error"]),
        flipped=bool(entry["flipped"]),
    )


def _encoded(value: object) -> Any:
    """Structs as {kind: fields}, tuples as lists, floats as hexadecimal text; other scalars as they are."""
    if isinstance(value, Struct):
        return {type(value).__name__: {name: _encoded(field) for name, field in structs.asdict(value).items()}}
    if isinstance(value, tuple):
        return [_encoded(entry) for entry in value]
    return value.hex() if isinstance(value, float) else value


def _decoded(value: Any) -> Any:
    if isinstance(value, dict):
        ((name, fields),) = value.items()
        return _KINDS[name](**{field: _decoded(entry) for field, entry in fields.items()})
    if isinstance(value, list):
        return tuple(_decoded(entry) for entry in value)
    return float.fromhex(value) if isinstance(value, str) else value
