"""The true image of any scene at float64 points: correctly rounded, or enclosed; proved by exact numbers and Arb balls.

    evaluate(scene, x, y)          Answers: every target at once, what float64 leaves over, which surface is seen
    settle(scene, x, y, target)    one target only: "float64", "float32" or "uint8"
    enclose(scene, x, y, bits=)    Enclosures: a ball about each value as narrow as is asked for
    index, hits                    which surface is seen; always decided

Comes in: a Scene; points of its image plane, whose float64 numbers and those of the scene in its camera's frame are
taken as exact. Goes out: what the real-number image is there. Never done here: a plan, or a digit that is not proved.

    one_sphere, one_sphere_exact              one grey sphere, one light: 10 us a point
    scene, light, light_exact                 everything else: 25 us and more, with spheres, lights and bounces
    whole, near, rays, sites                  the scene in whole numbers; what rays meet
    surds, signs                              exact numbers over nested square roots; what is asked of them
    rounding, answers, ask                    from balls to rounded numbers; arrays

AccuracyError names the points that are left: an exact tie that no fraction shows, a tie behind more than 4 mirrors.
python-flint's precision belongs to the process: another thread that changes it costs time here, never a wrong digit.
"""

from __future__ import annotations

from symrender_cg.reference.oracle.answers import Answers, Enclosures
from symrender_cg.reference.oracle.ask import TARGETS, Target, enclose, evaluate, hits, index, settle

__all__ = ["TARGETS", "Answers", "Enclosures", "Target", "enclose", "evaluate", "hits", "index", "settle"]
