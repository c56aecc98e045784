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
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, TypeVar

import tomli_w
from msgspec import Struct
from msgspec.structs import asdict

from symrender_cg.errors import SceneError
from symrender_cg.scene.model import Camera, Phong, PointLight, Scene, Sphere

_Model = TypeVar("_Model", bound=Struct)

_TABLES: Final[Mapping[tuple[type[Struct], str], type[Struct]]] = {
    (Scene, "camera"): Camera,
    (Sphere, "material"): Phong,
}
"""Fields that are one table of the file."""

_TABLE_LISTS: Final[Mapping[tuple[type[Struct], str], type[Struct]]] = {
    (Scene, "spheres"): Sphere,
    (Scene, "lights"): PointLight,
}
"""Fields that are a list of tables."""

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
        elif (model, key) in _TABLE_LISTS:
            arguments[key] = _read_tables(_TABLE_LISTS[model, key], value, inner)
        else:
            arguments[key] = value
    try:
        return model(**arguments)
    except SceneError as error:
        path = ".".join(part for part in (place, error.place) if part)
        raise SceneError(path, error.problem) from None


def _read_tables(model: type[_Model], tables: object, place: str) -> tuple[_Model, ...]:
    if not isinstance(tables, list):
        raise SceneError(
            place, f"{tables!r} is not a list of tables; expected one or more; write [[{place}]] above each"
        )
    return tuple(_read_table(model, table, f"{place}[{index}]") for index, table in enumerate(tables))


def _unknown_key(model: type[Struct], key: str, fields: tuple[str, ...]) -> str:
    nearest = difflib.get_close_matches(key.lower(), fields, n=1)
    suggestion = f"did you mean {nearest[0]!r}?" if nearest else "remove it"
    return f"unknown key; expected one of {', '.join(fields)} in a {model.__name__}; {suggestion}"


def write_scene(scene: Scene) -> str:
    """`scene` as TOML text: every field, vectors on one line, half_height left out when it is None."""
    table = asdict(scene)
    table["camera"] = {key: value for key, value in asdict(scene.camera).items() if value is not None}
    table["spheres"] = [asdict(sphere) | {"material": asdict(sphere.material)} for sphere in scene.spheres]
    table["lights"] = [asdict(light) for light in scene.lights]
    text = tomli_w.dumps({"background": scene.background} | table)
    return _NUMBERS_ON_LINES.sub(lambda match: f"[{', '.join(match[1].replace(',', '').split())}]", text)
