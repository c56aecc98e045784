"""`arrange(scene)` -> Arrangement: what a scene kernel loops over, without what provably cannot change the image.

    visibility   which spheres may own a pixel, which of them reach the plane of the eye; plane and tiles
    order        front to back, exactly
    mirrors      what is seen in what, how deep
    lamps        which light adds which term to which surface
    shadows      which spheres may come between

Comes in: a Scene in the camera's frame, the aspect of the window. Goes out: Arrangement, arrays of integers and truths
that depend on the set of spheres and lights and not on their order in the file, but for indices. Never done here:
sympy, a kernel, or a number for one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from symrender_cg.plan.examination import Examination, examine, look
from symrender_cg.plan.measures import Indices, Ints, Truths, colour
from symrender_cg.plan.order import canonical, front_to_back
from symrender_cg.plan.visibility import at_eye
from symrender_cg.scene import Phong, PointLight, Scene


@dataclass(frozen=True, slots=True, eq=False)
class Arrangement:
    """What there is to draw: S spheres, the first `visible` of which may own a pixel, and K lamps on receivers.

    A position is an index into `spheres`. A receiver is a position, then S for the plane's material, then S + 1 for its
    checker's, as far as `plane_materials` goes. What belongs to k is [begin[k], begin[k + 1]), so that every `*_begin`
    has one entry more.

    spheres         (S,) int32: index in scene.spheres; visible ones front to back by the power of the eye
    visible         how many may own a pixel
    at_eye          (visible,) bool: its pixels are tested one by one
    partners        positions j < k of visible spheres not proved disjoint from k, ascending
    crosses_plane   (S,) bool: not proved to lie wholly on the eye's side of the plane
    plane_seen      the plane may own a pixel
    plane_mirrored  the plane may be seen in a sphere
    plane_materials materials of the receivers S, S + 1; one where the tiles in view are all of one kind
    mirrored        (receivers,) bool: may be seen in a mirror
    lamp_light      (K,) int32: index in scene.lights, in an order by the lights' numbers
    lamp_diffuse, lamp_specular, lamp_gated    (K,) bool: terms that can be other than 0; the specular gated
    blockers        of a lamp: positions of spheres that may keep its light from some point, ascending
    mirror          (receivers,) bool: adds anything by reflection
    mirrors         positions that may be seen in a receiver, ascending
    mirror_plane    (receivers,) bool: the plane may be seen in it
    bounces         depth of mirrors that can matter, 0 without any
    """

    spheres: Ints
    visible: int
    at_eye: Truths
    partners_begin: Ints
    partners: Ints
    crosses_plane: Truths
    plane_seen: bool
    plane_mirrored: bool
    plane_materials: tuple[Phong, ...]
    mirrored: Truths
    lamps_begin: Ints
    lamp_light: Ints
    lamp_diffuse: Truths
    lamp_specular: Truths
    lamp_gated: Truths
    blockers_begin: Ints
    blockers: Ints
    mirror: Truths
    mirrors_begin: Ints
    mirrors: Ints
    mirror_plane: Truths
    bounces: int

    @property
    def receivers(self) -> int:
        """Number of receivers: the spheres and the plane's materials."""
        return len(self.lamps_begin) - 1


def arrange(
    frame_scene: Scene, *, aspect: float | None, anywhere: bool = False, force: frozenset[str] = frozenset()
) -> Arrangement:
    """The arrangement of a scene in the camera's frame for a window of that width over height.

    aspect None, or `anywhere`: any point of the image plane may be asked for. force: rules that are not to leave
    anything out (behind_eye, in_view, hidden, order, front_test, plane, checker, lights, diffuse, specular, shadow,
    mirror, mirror_depth); the image stays the same.
    """
    return assemble(examine(look(frame_scene, aspect=None if anywhere else aspect, force=force)))


def assemble(found: Examination) -> Arrangement:
    """The arrays of an Arrangement: spheres in their order, everything else by positions in it."""
    views, mirrors, lamps, blockers = found.views, found.mirrors, found.lamps, found.blockers
    measures, scene, force = views.measures, views.measures.scene, views.force
    count = measures.count
    eye = scene.camera.eye
    front = front_to_back(scene.spheres, np.flatnonzero(views.visible), eye, measures.distance, measures.radius)
    needed = mirrors.mirrored[:count].copy()
    needed[blockers[2]] = True
    others = canonical(measures.center, measures.radius, np.flatnonzero(needed & ~views.visible))
    spheres = np.concatenate((front, others))
    size, visible = len(spheres), len(front)
    planes = len(measures.plane_materials)
    position = np.full(count + planes, -1, dtype=np.int64)
    position[spheres] = np.arange(size)
    position[count:] = size + np.arange(planes)
    of_receiver = np.concatenate((spheres, count + np.arange(planes)))

    lights = _canonical_lights(scene)
    adds = lamps.any[np.ix_(of_receiver, lights)]
    receiver, rank = np.nonzero(adds)
    light = lights[rank]
    number = np.full((size + planes, len(lights)), -1, dtype=np.int64)
    number[receiver, light] = np.arange(len(receiver))
    lamp = number[position[blockers[0]], blockers[1]]
    at = (of_receiver[receiver], light)

    reflecting = [r for r in mirrors.seen if position[r] >= 0]
    seen_in = np.repeat(position[reflecting], [len(mirrors.seen[r]) for r in reflecting]).astype(np.int64)
    seen = position[np.concatenate([np.empty(0, dtype=np.int64), *(mirrors.seen[r] for r in reflecting)])]
    return Arrangement(
        spheres=spheres.astype(np.int32),
        visible=visible,
        at_eye=(at_eye(measures) | ("front_test" in force))[front],
        **_grouped("partners", visible, *_partners(found, position, visible)),
        crosses_plane=measures.crosses_plane[spheres],
        plane_seen=views.plane_seen,
        plane_mirrored=bool(mirrors.mirrored[count:].any()),
        plane_materials=measures.plane_materials,
        mirrored=mirrors.mirrored[of_receiver],
        lamps_begin=_begin(receiver, size + planes),
        lamp_light=light.astype(np.int32),
        lamp_diffuse=lamps.diffuse[at],
        lamp_specular=lamps.specular[at],
        lamp_gated=lamps.gated[at],
        **_grouped("blockers", len(receiver), lamp, position[blockers[2]]),
        mirror=mirrors.mirror[of_receiver],
        **_grouped("mirrors", size + planes, seen_in, seen),
        mirror_plane=mirrors.plane[of_receiver],
        bounces=mirrors.bounces,
    )


def _partners(found: Examination, position: Indices, visible: int) -> tuple[Indices, Indices]:
    """(position, earlier position) of visible spheres whose order along a ray is not proved."""
    views = found.views
    if "order" in views.force:
        k, j = np.tril_indices(visible, -1)
        return k.astype(np.int64), j.astype(np.int64)
    i, j, _ = views.touching
    both = views.visible[i] & views.visible[j]
    i, j = position[i[both]], position[j[both]]
    return np.maximum(i, j), np.minimum(i, j)


def _canonical_lights(scene: Scene) -> Indices:
    """Indices of the lights ordered by their numbers, so that sums do not depend on the order in the file."""

    def numbers(index: int) -> tuple[Any, ...]:
        light = scene.lights[index]
        if isinstance(light, PointLight):
            return 0, light.position, colour(light.intensity), light.attenuation, index
        return 1, light.direction, colour(light.intensity), (), index

    return np.array(sorted(range(len(scene.lights)), key=numbers), dtype=np.int64)


def _begin(group: Indices, groups: int) -> Ints:
    """Where each group of a sorted array begins, and its end."""
    return np.searchsorted(group, np.arange(groups + 1)).astype(np.int32)


def _grouped(name: str, groups: int, group: Indices, member: Indices) -> dict[str, Any]:
    """`name`_begin and `name`: members by group, ascending."""
    order = np.lexsort((member, group))
    return {f"{name}_begin": _begin(group[order], groups), name: member[order].astype(np.int32)}
