"""The peer POV-Ray 3.7: the picture and the trace time that the program makes of a scene.

Comes in: a Scene and the size of an image. Goes out: an image with its times (`draw`). Never done here: the text of the
scene (povray_text.py), or a judgement (agreement.py).

Output is linear, 16 bits a channel (PPM, File_Gamma 1), without antialiasing, jitter or dithering; POV-Ray clips it at
1, so a brighter scene is drawn with a `gain` below 1. Times are its own: the trace alone, to 1 ms.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.povray_text import channels, export
from symrender_cg import Scene

LEVELS: Final = 65535
INSTALL: Final = "apt-get install povray"


@dataclass(frozen=True, slots=True)
class Drawn:
    """POV-Ray's picture, (h, w) or (h, w, 3), 16-bit levels over the gain; times as its own statistics have them."""

    image: NDArray[np.float64]
    trace_seconds: float
    trace_cpu_seconds: float
    parse_seconds: float
    pictures: int
    level: float
    """the step of `image`; its values are within half of it of what POV-Ray computed"""


def find() -> str | None:
    """The POV-Ray program, if there is one."""
    return shutil.which("povray")


def version(program: str) -> str:
    """`POV-Ray 3.7...`, as the program says."""
    said = subprocess.run([program, "--version"], capture_output=True, text=True, check=False)
    lines = [line for line in (said.stdout + said.stderr).splitlines() if line.startswith("POV-Ray")]
    return lines[0] if lines else "POV-Ray"


def draw(
    program: str, scene: Scene, width: int, height: int, *, threads: int = 1, gain: float = 1.0, bsp: bool = False
) -> Drawn:
    """The scene drawn by `program` with that many threads: once, or once a channel (times are then those of the first).

    bsp: POV-Ray's other search structure (+BM2), faster from some hundred spheres on.
    Raises NotStatedError, and RuntimeError with POV-Ray's last lines where it fails.
    """
    texts = (export(scene, width, height, channel=channel, gain=gain) for channel in channels(scene))
    pictures = [_draw(program, text, width, height, threads, bsp) for text in texts]
    image = pictures[0][0] if len(pictures) == 1 else np.stack([p[0][..., 0] for p in pictures], axis=-1)
    wall, cpu, parse = pictures[0][1]
    values = (image if scene.channels == 3 else image[..., 0]) / (LEVELS * gain)
    return Drawn(values, wall, cpu, parse, len(pictures), 1.0 / (LEVELS * gain))


def _draw(
    program: str, text: str, width: int, height: int, threads: int, bsp: bool
) -> tuple[NDArray[np.uint16], tuple[float, float, float]]:
    with tempfile.TemporaryDirectory(prefix="symrender_pov_") as folder:
        source, target = Path(folder, "scene.pov"), Path(folder, "image.ppm")
        source.write_text(text, encoding="ascii")
        command = [program, f"+I{source}", f"+O{target}", "+FP16", f"+W{width}", f"+H{height}", f"+WT{threads}"]
        command += ["-D", "-A", "-J", "-V", "-P", "File_Gamma=1.0", "Dither=Off", "+BM2" if bsp else "+BM1"]
        done = subprocess.run(command, capture_output=True, text=True, cwd=folder, check=False)
        if done.returncode != 0 or not target.is_file():
            raise RuntimeError(f"povray failed with exit status {done.returncode}:\n{done.stderr[-2000:]}")
        return read_ppm(target.read_bytes()), _times(done.stderr)


def read_ppm(data: bytes) -> NDArray[np.uint16]:
    """A PPM of 16 bits: (h, w, 3)."""
    header = re.match(rb"P6\s(?:#[^\n]*\n|\s)*(\d+)\s(?:#[^\n]*\n|\s)*(\d+)\s(?:#[^\n]*\n|\s)*65535\s", data)
    if header is None:
        raise RuntimeError(f"povray wrote no PPM of 16 bits, but {data[:32]!r}")
    width, height = int(header[1]), int(header[2])
    return np.frombuffer(data[header.end() :], ">u2").reshape(height, width, 3).astype(np.uint16)


def _times(said: str) -> tuple[float, float, float]:
    """(wall, processor) seconds of tracing and the wall seconds of parsing, from the statistics."""
    pattern = r"{} Time:[^(]*\((\d+\.\d+) seconds\)\s+using \d+ thread\(s\) with (\d+\.\d+) CPU-seconds"
    trace, parse = (re.search(pattern.format(name), said) for name in ("Trace", "Parse"))
    if trace is None or parse is None:
        raise RuntimeError("povray printed no statistics of its time")
    return float(trace[1]), float(trace[2]), float(parse[1])
