"""What every test runs under: a private cache for compiled kernels, hypothesis without deadlines, and `--update`.

The cache is a temporary folder that all workers of one run share and that is removed after it: no test reads or writes
the user's own. SYMRENDER_THOROUGH=1 asks hypothesis for twenty times as many examples, where a test does not say how
many.
"""

from __future__ import annotations

import os
import shutil
import tempfile

import pytest
from hypothesis import HealthCheck, settings

settings.register_profile("ordinary", deadline=None, suppress_health_check=[HealthCheck.too_slow], print_blob=True)
settings.register_profile("thorough", parent=settings.get_profile("ordinary"), max_examples=2000)
settings.load_profile("thorough" if os.environ.get("SYMRENDER_THOROUGH") == "1" else "ordinary")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--update", action="store_true", help="bring generated/ up to date instead of failing where it is not"
    )


def pytest_configure(config: pytest.Config) -> None:
    if hasattr(config, "workerinput"):
        return  # a worker of pytest-xdist has the environment of the process that started it
    folder = tempfile.mkdtemp(prefix="symrender_cg-tests-")
    os.environ["SYMRENDER_CACHE_DIR"] = folder
    config.add_cleanup(lambda: shutil.rmtree(folder, ignore_errors=True))
