"""`parameter_sets`: what render_batch is to draw, one scene a set.

In: a scene and a mapping of dotted paths ("lights.0.position", "spheres[0].radius") to arrays of one value a set, or a
sequence of scenes. Out: `Sets`: how many there are, and the scene of each, made when it is asked for. A name that the
scene does not have, a shape that does not fit its field, and lengths that differ are refused before anything is drawn.
Never here: a decision about kernels.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import cached_property
from typing import Any, get_args, get_origin

import numpy as np
from msgspec import Struct, structs
from numpy.typing import ArrayLike, NDArray

from symrender_cg.errors import ArgumentError, SceneError
from symrender_cg.scene import Scene

Path = tuple[str | int, ...]
Parameters = Mapping[str, ArrayLike] | Sequence[Scene]


@dataclass(frozen=True)
class Sets:
    """The sets of a batch: `scenes`, or `base` with each of `columns` in its place: (count,) or (count, 3), by path."""

    count: int
    base: Scene
    scenes: tuple[Scene, ...] = ()
    columns: Mapping[Path, NDArray[Any]] = field(default_factory=dict)

    def scene(self, index: int) -> Scene:
        """The scene of a set. Raises SceneError, with the number of the set, where it has no image."""
        if self.scenes:
            return self.scenes[index]
        try:
            scene = _replaced(self.base, self._tree, index, "")
        except SceneError as problem:
            raise SceneError(f"parameters, set {index}: {problem.place}", problem.problem) from None
        assert isinstance(scene, Scene)
        return scene

    @cached_property
    def _tree(self) -> dict[str | int, Any]:
        return _as_tree(self.columns)


def parameter_sets(scene: Scene, parameters: Parameters) -> Sets:
    """The sets that `parameters` names. Raises ArgumentError for what is not one of the two kinds, or fits nothing."""
    if isinstance(parameters, Mapping):
        return _of_mapping(scene, parameters)
    if isinstance(parameters, str | Scene) or not isinstance(parameters, Sequence):
        raise ArgumentError(
            f"parameters: {type(parameters).__name__} is not known; expected a sequence of scenes, or a mapping of "
            'paths such as "lights.0.position" to arrays of one value a set'
        )
    if not parameters:
        raise ArgumentError("parameters: there is no set; expected one scene or more")
    for index, each in enumerate(parameters):
        if not isinstance(each, Scene):
            raise ArgumentError(f"parameters[{index}]: expected a Scene, not {type(each).__name__}")
    channels = parameters[0].channels
    for index, each in enumerate(parameters):
        if each.channels != channels:
            kinds = {1: "grey", 3: "in colour"}
            raise ArgumentError(
                f"parameters[{index}]: is {kinds[each.channels]}, and parameters[0] is {kinds[channels]}; expected one "
                "kind, for one array; write a grey as (value, value, value)"
            )
    return Sets(len(parameters), parameters[0], tuple(parameters))


def _of_mapping(scene: Scene, parameters: Mapping[str, ArrayLike]) -> Sets:
    if not parameters:
        raise ArgumentError('parameters: is empty; expected paths such as "lights.0.position", each with an array')
    columns: dict[Path, NDArray[Any]] = {}
    count, counted = 0, ""
    for name, values in parameters.items():
        path, number, triple = _resolved(scene, name)
        column = _column(name, values, number=number, triple=triple)
        if counted and len(column) != count:
            raise ArgumentError(
                f"parameters[{name!r}]: has {len(column)} sets, and parameters[{counted!r}] has {count}; expected one "
                "value of each for every set"
            )
        count, counted = len(column), counted or name
        for other in columns:
            shorter = min(len(path), len(other))
            if path[:shorter] == other[:shorter]:
                raise ArgumentError(f"parameters[{name!r}]: another entry sets it too, or a part of it; give it once")
        columns[path] = column
    if count == 0:
        raise ArgumentError(f"parameters[{counted!r}]: there is no set; expected one value or more")
    return Sets(count, scene, (), columns)


def _resolved(scene: Scene, name: str) -> tuple[Path, bool, bool]:
    """The path of a name, and whether its field takes a number, and three."""
    if not isinstance(name, str):
        raise ArgumentError(f"parameters: {name!r} is not a path; expected text such as 'lights.0.position'")
    words = re.sub(r"\[(\d+)\]", r".\1", name).split(".")
    value: Any = scene
    path: list[str | int] = []
    for k, word in enumerate(words):
        place = ".".join(words[:k]) or "the scene"
        if isinstance(value, Struct):
            kinds = {entry.name: entry.type for entry in structs.fields(value)}
            if word not in kinds:
                near = get_close_matches(word, kinds, 1)
                hint = f"; did you mean {near[0]!r}?" if near else ""
                raise ArgumentError(f"parameters[{name!r}]: {place} has no {word!r}; it has {', '.join(kinds)}{hint}")
            kind, value = kinds[word], getattr(value, word)
            path.append(word)
        elif isinstance(value, tuple):
            if not word.isdecimal() or int(word) >= len(value):
                raise ArgumentError(
                    f"parameters[{name!r}]: {place} has no {word!r}; expected a number from 0 to {len(value) - 1}"
                )
            kind, value = float, value[int(word)]
            path.append(int(word))
        else:
            raise ArgumentError(f"parameters[{name!r}]: {place} is {value!r}, which has no parts; leave {word!r} out")
    number, triple = _takes(kind)
    if isinstance(value, Struct) or (isinstance(value, tuple) and not triple) or not (number or triple):
        inside = ", ".join(value.__struct_fields__) if isinstance(value, Struct) else "its numbers, 0 and up"
        what = (
            f"has parts of its own; name one of them: {inside}" if value is not None else "is None; give the scene one"
        )
        raise ArgumentError(f"parameters[{name!r}]: {what}")
    return tuple(path), number, triple


def _takes(kind: Any) -> tuple[bool, bool]:
    """Whether a field of that type takes a number, and whether it takes three."""
    kinds = (kind,) if kind in (float, int, bool) or get_origin(kind) is tuple else get_args(kind)
    number = any(entry in (float, int, bool) for entry in kinds)
    triple = any(get_origin(entry) is tuple and get_args(entry) == (float, float, float) for entry in kinds)
    return number, triple


def _column(name: str, values: ArrayLike, *, number: bool, triple: bool) -> NDArray[Any]:
    column = np.asarray(values)
    shapes = " or ".join([*(["(count,)"] if number else []), *(["(count, 3)"] if triple else [])])
    if column.dtype.kind not in "fiub":
        raise ArgumentError(f"parameters[{name!r}]: expected real numbers, not an array of {column.dtype}")
    if not ((number and column.ndim == 1) or (triple and column.ndim == 2 and column.shape[1] == 3)):
        raise ArgumentError(f"parameters[{name!r}]: has shape {column.shape}; expected {shapes}, one value a set")
    return column


def _as_tree(columns: Mapping[Path, NDArray[Any]]) -> dict[str | int, Any]:
    tree: dict[str | int, Any] = {}
    for path, column in columns.items():
        branch = tree
        for word in path[:-1]:
            branch = branch.setdefault(word, {})
        branch[path[-1]] = column
    return tree


def _replaced(value: Any, tree: dict[str | int, Any] | NDArray[Any], index: int, place: str) -> Any:
    """The value with what the tree names put in its place; errors are placed in the whole scene."""
    if not isinstance(tree, dict):
        found = tree[index].tolist()
        return tuple(found) if isinstance(found, list) else found
    if isinstance(value, tuple):
        return tuple(
            _replaced(entry, tree[k], index, f"{place}[{k}]") if k in tree else entry for k, entry in enumerate(value)
        )
    inner = f"{place}." if place else ""
    changes = {
        str(word): _replaced(getattr(value, str(word)), branch, index, f"{inner}{word}")
        for word, branch in tree.items()
    }
    try:
        return structs.replace(value, **changes)
    except SceneError as problem:
        raise SceneError(inner + problem.place, problem.problem) from None
