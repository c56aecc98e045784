"""Scenes that come with the package, and the one rule by which a scene is named.

Comes in: a name, a path, or a Scene. Goes out: a Scene. A built-in scene is a file of the folder
symrender_cg/scenes; its name is the file's, its description the comment that opens it. Never done here: reading TOML.
"""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import Final

from symrender_cg.errors import SceneError
from symrender_cg.scene.files import read_scene
from symrender_cg.scene.model import Scene

_FOLDER: Final = Path(__file__).resolve().parent.parent / "scenes"


def builtin_names() -> tuple[str, ...]:
    """Names of the built-in scenes, in alphabetical order."""
    return tuple(sorted(path.stem for path in _FOLDER.glob("*.toml")))


def builtin_scene(name: str) -> Scene:
    """The built-in scene `name`. Raises SceneError with the nearest name and all names when there is none such."""
    return read_scene(_builtin_path(name))


def builtin_description(name: str) -> str:
    """What the built-in scene `name` shows, on one line: the comment that opens its file."""
    lines = _builtin_path(name).read_text(encoding="utf-8").splitlines()
    comment = []
    for line in lines:
        if not line.startswith("#"):
            break
        comment.append(line.removeprefix("#").strip())
    return " ".join(comment)


def _builtin_path(name: str) -> Path:
    names = builtin_names()
    if name not in names:
        raise SceneError("", f"no built-in scene is named {name!r}; {_known(name, names)}")
    return _FOLDER / f"{name}.toml"


def _known(name: str, names: tuple[str, ...]) -> str:
    nearest = difflib.get_close_matches(str(name).lower(), names, n=1)
    suggestion = f"; did you mean {nearest[0]!r}?" if nearest else ""
    return f"expected one of {', '.join(names)}{suggestion}"


def named_scene(name_or_path: str | Path | Scene) -> Scene:
    """A Scene as it is, a file read, else the built-in scene of that name; the rule is that of load_scene."""
    if isinstance(name_or_path, Scene):
        return name_or_path
    if isinstance(name_or_path, Path):
        return read_scene(name_or_path)
    if not isinstance(name_or_path, str):
        raise SceneError(
            "", f"{name_or_path!r} does not name a scene; expected a Scene, a path, or a built-in scene's name"
        )
    if name_or_path.endswith(".toml") or Path(name_or_path).is_file():
        return read_scene(name_or_path)
    names = builtin_names()
    if name_or_path not in names:
        raise SceneError(
            "", f"{name_or_path!r} is neither a scene file nor a built-in scene; {_known(name_or_path, names)}"
        )
    return builtin_scene(name_or_path)
