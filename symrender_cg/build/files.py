"""Files and folders that others see whole or not at all: written under an unused name, renamed, moved aside.

In: paths. Out: files and folders, or their absence. Never here: what is in them.
"""

from __future__ import annotations

import os
import time
from pathlib import Path

ABANDONED_SECONDS = 3600.0  # a build that is still under a dotted name after an hour was killed


def write_whole(path: Path, text: str) -> None:
    """Write a file that others see whole or not at all."""
    unfinished = path.parent / unused_name(path.stem[:16])
    try:
        unfinished.write_text(text, encoding="utf-8")
        os.replace(unfinished, path)
    finally:
        unfinished.unlink(missing_ok=True)


def unused_name(purpose: str) -> str:
    """A dotted name that no other process or thread uses."""
    return f".{purpose}-{os.getpid()}-{os.urandom(6).hex()}"


def discard(path: Path) -> None:
    """Make an entry disappear at once for every reader, then remove it."""
    aside = path.parent / unused_name("removed")
    try:
        os.rename(path, aside)
    except OSError:
        return  # another process was faster, or the place is read-only
    remove(aside)


def remove(path: Path) -> None:
    """Remove a file or a folder, as far as it goes."""
    if path.is_dir():
        import shutil

        shutil.rmtree(path, ignore_errors=True)
        return
    try:
        path.unlink(missing_ok=True)
    except OSError:
        return


def remove_abandoned(folder: Path) -> None:
    """Remove what killed processes left behind under dotted names."""
    oldest = time.time() - ABANDONED_SECONDS
    for path in children(folder):
        if path.name.startswith(".") and _modified(path) < oldest:
            remove(path)


def remove_at_exit(folder: Path, owner: int) -> None:
    """Remove a folder in the process that made it, not in a child of fork."""
    if os.getpid() == owner:
        remove(folder)


def children(folder: Path) -> list[Path]:
    """What a folder holds, sorted; nothing where there is no such folder."""
    try:
        return sorted(folder.iterdir())
    except OSError:
        return []


def size_of(path: Path) -> int:
    """Bytes of a file; 0 for a folder, or for what has gone meanwhile."""
    try:
        return path.stat().st_size if path.is_file() else 0
    except OSError:
        return 0


def _modified(path: Path) -> float:
    try:
        return path.lstat().st_mtime
    except OSError:
        return float("inf")
