"""Generated code as files: a Translation -> texts by place, and a folder brought up to date with them.

    <folder>/<kernel>/<kernel>.c, <kernel>.h, manifest.json     one folder a kernel
    <folder>/support/*.h                                        shared by all kernels

Comes in: a Translation, or the texts that the cache kept of one. Goes out: files, and what became of each.
Never done here: sympy, compiling, a date, a path or a host in a text: the same input gives the same bytes.
"""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal

from symrender_cg.errors import ArgumentError
from symrender_cg.output import replacing
from symrender_cg.version import VERSION

if TYPE_CHECKING:
    from symrender_cg.pipeline import Translation

LAYOUT: Final = 3
"""Counts the changes of what is written here, so that what an older version kept is not taken for up to date."""

SUPPORT: Final = "support"
MANIFEST: Final = "manifest.json"
ENCLOSES: Final = "hi, lo and error, |true intensity - (hi + lo)| <= error, at every point; inf where nothing is known"
"""What the enclosure of a scene promises, whichever level rests on it."""
_STANDS_IN_COMMENTS: Final = re.compile(r"[\w.+@=/, -]{1,60}", re.ASCII)

Status = Literal["new", "updated", "unchanged"]


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of one file: its place below the folder (with /), and whether it was new, updated or unchanged."""

    place: str
    status: Status


def generate(translation: Translation, *, command: str, numbers: Mapping[str, float] | None = None) -> dict[str, str]:
    """The texts of a kernel by their place below the folder of generated code.

    `command` is the one that the translation was made with; `numbers` are those baked in, if any.
    """
    text = manifest_text(translation, command=command, numbers=numbers)
    return places(translation.emitted.name, translation.emitted.files, text)


def places(kernel: str, texts: Mapping[str, str], manifest: str) -> dict[str, str]:
    """Place -> text: the kernel's own files and its manifest in its folder, everything else under support/."""
    own = {f"{kernel}/{name}": text for name, text in texts.items() if Path(name).stem == kernel}
    shared = {f"{SUPPORT}/{name}": text for name, text in texts.items() if Path(name).stem != kernel}
    return own | {f"{kernel}/{MANIFEST}": manifest} | shared


def manifest_text(translation: Translation, *, command: str, numbers: Mapping[str, float] | None = None) -> str:
    """manifest.json of a kernel: what it is, what its plan rests on, its inputs, its cost, how to remake it.

    The enclosure of a scene has the accuracy `enclosure`: it is the same for every level that rests on it.

    Of the kernel of a scene also its parts, each with its operations by rate, and the shapes of its structure's fields.
    """
    emitted, variant = translation.emitted, translation.variant
    own = [name for name in emitted.files if Path(name).stem == emitted.name]
    encloses = variant.settles is not None and translation.plan.arrangement is not None
    manifest = {
        "layout": LAYOUT,
        "name": emitted.name,
        "made_by": f"symrender_cg {VERSION}",
        "command": command,
        "accuracy": "enclosure" if encloses else variant.name,
        "promise": ENCLOSES if encloses else variant.promise,
        "plan": [
            {
                "effect": decision.effect.name,
                "title": decision.effect.title,
                "status": decision.status,
                "reason": decision.reason,
                "margin": decision.margin,
                "bound": decision.bound,
            }
            for decision in translation.plan.decisions
        ],
        "inputs": list(emitted.inputs),
        "baked": dict(sorted(numbers.items())) if numbers is not None else {},
        "result_type": emitted.result_type,
        "operations": {rate: dict(sorted(counts.items())) for rate, counts in emitted.operations.items()},
        **_scene_entries(translation),
        "files": own,
        "support": sorted(f"{SUPPORT}/{name}" for name in emitted.files if name not in own),
    }
    return json.dumps(manifest, indent=2, ensure_ascii=True) + "\n"


def _scene_entries(translation: Translation) -> dict[str, Any]:
    """What the manifest of a scene's kernel says beside that of one sphere's."""
    if translation.plan.arrangement is None:
        return {}
    from symrender_cg.explain import part_operations

    return {
        "channels": 3 if "colour" in translation.plan.flags else 1,
        "flags": sorted(translation.plan.flags),
        "fields": [{"name": name, "shape": shape} for name, shape in translation.emitted.fields],
        "parts": part_operations(translation),
    }


def outcomes(files: Mapping[str, str], folder: Path) -> tuple[Outcome, ...]:
    """What write() would do with each text, without doing it."""
    return tuple(Outcome(place, _status(folder / place, text)) for place, text in files.items())


def write(files: Mapping[str, str], folder: Path) -> tuple[Outcome, ...]:
    """Brings the folder up to date with the texts; files that are right already are not touched.

    Raises ArgumentError where the folder cannot be written.
    """
    found = outcomes(files, folder)
    for outcome in found:
        if outcome.status != "unchanged":
            path = folder / outcome.place
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
            except OSError as problem:
                raise ArgumentError(
                    f"{path.parent}: cannot be made: {problem.strerror or problem}; choose another folder for the C"
                ) from None
            with replacing(path) as file:
                file.write(files[outcome.place].encode())
    return found


def regenerate_command(scene: str | None, accuracy: str, *, target: str | None = None, bake: bool = False) -> str:
    """The command line that makes a kernel again; it stands in C comments.

    The scene is named as the user did: a built-in name, or a path relative to where they are. Of a path that is
    absolute, long, or has letters that could end a comment, the file's name is left, or the word SCENE.
    """
    named = "chapter1" if scene is None else scene
    candidates = (named, Path(named).name, "SCENE")
    chosen = next(c for c in candidates if _STANDS_IN_COMMENTS.fullmatch(c) and not Path(c).is_absolute())
    words = ["python", "-m", "symrender_cg", "build", chosen, "--accuracy", accuracy]
    words += ["--target", target] if target is not None else []
    words += ["--bake"] if bake else []
    return shlex.join(words)


def _status(path: Path, text: str) -> Status:
    try:
        return "unchanged" if path.read_bytes() == text.encode() else "updated"
    except FileNotFoundError:
        return "new"
    except OSError:
        return "updated"
