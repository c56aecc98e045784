"""The driver: from a scene to a loaded kernel, one timed call a stage.

    stage    in -> out                            owner
    plan     Scene -> Plan                        symrender_cg.plan
    derive   Plan -> ImageProgram, or Parts       symrender_cg.derive
    lower    each of them -> KernelProgram        symrender_cg.lower
    emit     KernelPrograms -> C text             symrender_cg.emit
    build    C text -> library                    symrender_cg.build
    run      library + numbers -> image           symrender_cg.run

What is one sphere under one light is one ImageProgram; every other scene is drawn by loops over the Parts of one.

A kernel is remembered twice: in this process, and in the cache on disk under its recipe (plan, accuracy, version of the
compiler), so that neither sympy nor a C compiler is touched when only numbers change. When numbers change so that the
plan does, the scene gets another kernel, and a line at debug level says so.

    counts         what was done so far
    plans          Scene -> Plan, remembered
    recipes        which kernel a plan and a level make, and its name in the cache
    translation    the stages from plan to emit, timed
    kernels        the build stage: a kernel remembered, recalled or compiled
    proving        the kernels that prove values
    drawing        a scene bound to its kernel
"""

from symrender_cg.pipeline.counts import Statistics, statistics
from symrender_cg.pipeline.drawing import draw
from symrender_cg.pipeline.kernels import build_kernel, compile_kernel
from symrender_cg.pipeline.plans import note, pixel_size, planned
from symrender_cg.pipeline.proving import enclosure_kernel, settling_kernel
from symrender_cg.pipeline.recipes import ENCLOSURE, enclosure_name, recipe_of, require_kind
from symrender_cg.pipeline.translation import (
    SceneTranslation,
    SphereTranslation,
    Translation,
    translate,
    translate_enclosure,
)

__all__ = [
    "ENCLOSURE",
    "SceneTranslation",
    "SphereTranslation",
    "Statistics",
    "Translation",
    "build_kernel",
    "compile_kernel",
    "draw",
    "enclosure_kernel",
    "enclosure_name",
    "note",
    "pixel_size",
    "planned",
    "recipe_of",
    "require_kind",
    "settling_kernel",
    "statistics",
    "translate",
    "translate_enclosure",
]
