"""Scene files: TOML text <-> Scene.

Comes in: a path, or TOML text. Goes out: a Scene, or its text; reading what was written gives an equal scene, bit for
bit. The keys are the names of the model's fields and nothing else: an unknown key is refused with its path and the
nearest known one. Never done here: a check of a value (the model does that; its errors get the path in the file).
"""

from __future__ import annotations

import difflib
import os
import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final, TypeVar

import tomli_w
from msgspec import Struct
from msgspec.structs import asdict

from symrender_cg.errors import SceneError
from symrender_cg.scene.model import Camera, DirectionalLight, Gradient, Phong, Plane, PointLight, Scene, Sphere

_Model = TypeVar("_Model", bound=Struct)

_TABLES: Final[Mapping[tuple[type[Struct], str], type[Struct]]] = {
    (Scene, "camera"): Camera,
    (Scene, "plane"): Plane,
    (Sphere, "material"): Phong,
    (Plane, "material"): Phong,
    (Plane, "checker"): Phong,
}
"""Fields that are one table of the file."""

_LIGHT_KEYS: Final = tuple(dict.fromkeys((*PointLight.__struct_fields__, *DirectionalLight.__struct_fields__)))

_NUMBERS_ON_LINES: Final = re.compile(r"\[\n((?: *[-+0-9.e]+,\n)+)\]")


def read_scene(path: str | os.PathLike[str]) -> Scene:
    """The scene in the TOML file at `path`. Raises SceneError, whose text ends with the file's name."""
    name = os.fspath(path)
    try:
        text = Path(name).read_bytes().decode("utf-8")
    except FileNotFoundError:
        raise SceneError(
            "", f"there is no file {name!r}; expected the path of a TOML scene file; check the path"
        ) from None
    except UnicodeDecodeError as error:
        raise SceneError("", f"{name!r} is not text in UTF-8 ({error.reason}); expected a TOML scene file") from None
    except OSError as error:
        reason = error.strerror or str(error)
        raise SceneError("", f"{name!r} cannot be read ({reason}); expected the path of a TOML scene file") from None
    return parse_scene(text, source=name)


def parse_scene(text: str, *, source: str = "scene text") -> Scene:
    """The scene in TOML `text`; `source` names it in messages."""
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise SceneError("", f"{source} is not valid TOML: {error}; correct that line") from None
    try:
        return _read_table(Scene, table, "")
    except SceneError as error:
        raise SceneError(error.place, f"{error.problem} (in {source})") from None


def _read_table(model: type[_Model], table: object, place: str) -> _Model:
    """A table of the file as one class of the model, with the path `place` in front of each error's place."""
    if not isinstance(table, dict):
        raise SceneError(
            place, f"{table!r} is not a table; expected keys of a {model.__name__}; write [{place}] above them"
        )
    fields = model.__struct_fields__
    arguments: dict[str, Any] = {}
    for key, value in table.items():
        inner = f"{place}.{key}" if place else key
        if key not in fields:
            raise SceneError(inner, _unknown_key(model, key, fields))
        if (model, key) in _TABLES:
            arguments[key] = _read_table(_TABLES[model, key], value, inner)
        elif (model, key) == (Scene, "spheres"):
            arguments[key] = tuple(_read_table(Sphere, entry, at) for entry, at in _entries(value, inner))
        elif (model, key) == (Scene, "lights"):
            arguments[key] = tuple(_read_light(entry, at) for entry, at in _entries(value, inner))
        elif (model, key) == (Scene, "background") and isinstance(value, dict):
            arguments[key] = _read_table(Gradient, value, inner)
        else:
            arguments[key] = value
    try:
        return model(**arguments)
    except SceneError as error:
        path = ".".join(part for part in (place, error.place) if part)
        raise SceneError(path, error.problem) from None


def _entries(tables: object, place: str) -> Iterator[tuple[object, str]]:
    """Each entry of a list of tables, with its path."""
    if not isinstance(tables, list):
        raise SceneError(
            place, f"{tables!r} is not a list of tables; expected one or more; write [[{place}]] above each"
        )
    for index, table in enumerate(tables):
        yield table, f"{place}[{index}]"


def _read_light(table: object, place: str) -> PointLight | DirectionalLight:
    """A table with `direction` as a DirectionalLight, else as a PointLight."""
    if not isinstance(table, dict):
        return _read_table(PointLight, table, place)
    for key in table:
        if key not in _LIGHT_KEYS:
            nearest = difflib.get_close_matches(key.lower(), _LIGHT_KEYS, n=1)
            raise SceneError(
                f"{place}.{key}",
                f"unknown key; expected one of {', '.join(PointLight.__struct_fields__)} in a PointLight or "
                f"{', '.join(DirectionalLight.__struct_fields__)} in a DirectionalLight; {_suggestion(nearest)}",
            )
    if "direction" not in table:
        return _read_table(PointLight, table, place)
    for key, remedy in (
        ("position", "remove one of the two, or write two lights"),
        ("attenuation", "remove it, or write position for a light that is somewhere"),
    ):
        if key in table:
            raise SceneError(
                f"{place}.{key}",
                f"unknown key beside direction; expected direction and intensity in a DirectionalLight, whose light "
                f"comes from no point; {remedy}",
            )
    return _read_table(DirectionalLight, table, place)


def _unknown_key(model: type[Struct], key: str, fields: tuple[str, ...]) -> str:
    nearest = difflib.get_close_matches(key.lower(), fields, n=1)
    return f"unknown key; expected one of {', '.join(fields)} in a {model.__name__}; {_suggestion(nearest)}"


def _suggestion(nearest: list[str]) -> str:
    return f"did you mean {nearest[0]!r}?" if nearest else "remove it"


def write_scene(scene: Scene) -> str:
    """`scene` as TOML text: every field, vectors on one line; what is None (half_height, plane, checker) left out."""
    fields = _table(scene)
    tables = {key: value for key, value in fields.items() if isinstance(value, (dict, list)) and _holds_tables(value)}
    text = tomli_w.dumps({key: value for key, value in fields.items() if key not in tables} | tables)
    return _NUMBERS_ON_LINES.sub(lambda match: f"[{', '.join(match[1].replace(',', '').split())}]", text)


def _table(model: Struct) -> dict[str, Any]:
    """The fields of one object as a table of the file, without those that are None."""
    return {key: _written(value) for key, value in asdict(model).items() if value is not None}


def _written(value: object) -> object:
    """An object as a table, a tuple as a list, anything else as it is."""
    if isinstance(value, Struct):
        return _table(value)
    return [_written(entry) for entry in value] if isinstance(value, tuple) else value


def _holds_tables(value: dict[str, Any] | list[Any]) -> bool:
    """Whether TOML has to write the value below all numbers of its table; an empty list is a value like a number."""
    return isinstance(value, dict) or any(isinstance(entry, dict) for entry in value)
