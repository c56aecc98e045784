"""symrender_cg: a scene becomes its image as one formula, the formula C99, the C99 a native `render_image()`.

    from symrender_cg import Scene, render_image
    image = render_image(Scene.chapter1(), 1920, 1080)

Nothing heavy is imported until it is used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from symrender_cg.version import VERSION as __version__

if TYPE_CHECKING:
    from symrender_cg.cost.choose import Choice, choose
    from symrender_cg.errors import (
        AccuracyError,
        ArgumentError,
        CompileError,
        CompilerNotFoundError,
        LibraryError,
        OutsidePlanError,
        SceneError,
        SymrenderError,
        ToolchainError,
    )
    from symrender_cg.pipeline import compile_kernel, statistics, translate
    from symrender_cg.run.batch import render_batch
    from symrender_cg.run.blocks import render_blocks
    from symrender_cg.run.certificate import Certificate, Certified
    from symrender_cg.run.render import certify, evaluate, render_image, render_layers
    from symrender_cg.scene import (
        Camera,
        DirectionalLight,
        Gradient,
        Phong,
        Plane,
        PointLight,
        Scene,
        Sphere,
        load_scene,
    )

_HOME = {
    "Camera": "scene",
    "DirectionalLight": "scene",
    "Gradient": "scene",
    "Phong": "scene",
    "Plane": "scene",
    "PointLight": "scene",
    "Scene": "scene",
    "Sphere": "scene",
    "load_scene": "scene",
    "compile_kernel": "pipeline",
    "statistics": "pipeline",
    "translate": "pipeline",
    "Certificate": "run.certificate",
    "Certified": "run.certificate",
    "Choice": "cost.choose",
    "choose": "cost.choose",
    "certify": "run.render",
    "evaluate": "run.render",
    "render_batch": "run.batch",
    "render_blocks": "run.blocks",
    "render_image": "run.render",
    "render_layers": "run.render",
    "AccuracyError": "errors",
    "ArgumentError": "errors",
    "CompileError": "errors",
    "CompilerNotFoundError": "errors",
    "LibraryError": "errors",
    "OutsidePlanError": "errors",
    "SceneError": "errors",
    "SymrenderError": "errors",
    "ToolchainError": "errors",
}

__all__ = [
    "AccuracyError",
    "ArgumentError",
    "Camera",
    "Certificate",
    "Certified",
    "Choice",
    "CompileError",
    "CompilerNotFoundError",
    "DirectionalLight",
    "Gradient",
    "LibraryError",
    "OutsidePlanError",
    "Phong",
    "Plane",
    "PointLight",
    "Scene",
    "SceneError",
    "Sphere",
    "SymrenderError",
    "ToolchainError",
    "__version__",
    "certify",
    "choose",
    "compile_kernel",
    "evaluate",
    "load_scene",
    "render_batch",
    "render_blocks",
    "render_image",
    "render_layers",
    "statistics",
    "translate",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = globals()[name] = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    return found


def __dir__() -> list[str]:
    return sorted(__all__)
