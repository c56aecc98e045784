"""Measurements kept on disk, by what they depend on: a text under the name of a key's digest.

Comes in: a kind and a key. Goes out: bytes that were kept, or None. Never done here: a decision about what is fresh;
the key says it. A place that cannot be written loses nothing but the next measurement.

    <root>/cost/<kind>-<sha256>.json      the root is that of the kernels, see symrender_cg.build.cache
"""

from __future__ import annotations

import hashlib
import json
import os
import secrets
from contextlib import suppress
from pathlib import Path

from symrender_cg.build.cache import default_root
from symrender_cg.build.toolchain import cpu_identity

FOLDER = "cost"


def read(kind: str, key: object, *, root: str | Path | None = None) -> bytes | None:
    """What was written under that kind and key on this processor."""
    try:
        return _place(kind, key, root).read_bytes()
    except OSError:
        return None


def write(kind: str, key: object, data: bytes, *, root: str | Path | None = None) -> None:
    """Keeps `data`, whole or not at all."""
    place = _place(kind, key, root)
    with suppress(OSError):
        place.parent.mkdir(parents=True, exist_ok=True)
        fresh = place.with_name(f".{secrets.token_hex(8)}")
        fresh.write_bytes(data)
        os.replace(fresh, place)


def _place(kind: str, key: object, root: str | Path | None) -> Path:
    digest = hashlib.sha256(json.dumps([cpu_identity(), key]).encode()).hexdigest()
    return Path(root if root is not None else default_root()) / FOLDER / f"{kind}-{digest}.json"
