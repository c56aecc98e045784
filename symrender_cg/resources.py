"""Where the templates are: beside the package in a checkout, inside it once it is installed."""

from __future__ import annotations

from functools import cache
from pathlib import Path


@cache
def templates() -> Path:
    """The folder of the templates, the support headers and the list of compile flags."""
    package = Path(__file__).resolve().parent
    installed, checkout = package / "templates", package.parent / "templates"
    return installed if installed.is_dir() else checkout


def template_path(name: str) -> Path:
    """The path of one file below the templates, such as `support/double_double.h`."""
    return templates() / name
