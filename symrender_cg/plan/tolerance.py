"""What a tolerance may leave out: terms of lamps and deeper bounces, smallest first, the sum of bounds below it.

Comes in: Measures, Mirrors, Lamps, max_error. Goes out: Budget: what is bounded, and by how much. Never done here: a
proof of absence.

A term of a lamp is at most coefficient intensity / (a + b l + c l^2) at the least distance l from the receiver; mirrors
pass on an error of what they show rho times, so that it counts 1 + rho + ... + rho^bounces times. Bounces beyond the
b-th add at most rho^(b + 1) times the brightest that is left to see. One pixel sees one receiver: terms on different
receivers do not add, terms on one do.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Final

import numpy as np

from symrender_cg.plan.lamps import Lamps
from symrender_cg.plan.measures import Floats, Measures, Truths, colour, norm
from symrender_cg.plan.mirrors import Mirrors
from symrender_cg.scene import Gradient, PointLight

_ROUNDED_UP: Final = 1.0 + 2.0**-40


@dataclass(frozen=True)
class Brightness:
    """Upper bounds: of each term of each lamp (receivers, lights), the largest channel; of a receiver's ambient and its
    terms together (receivers,); of the background; `share`, the largest reflect of a mirror."""

    diffuse: Floats
    specular: Floats
    receiver: Floats
    background: float
    share: float

    def passed_on(self, bounces: int) -> float:
        """1 + rho + ... + rho^bounces."""
        return float(sum(self.share**k for k in range(bounces + 1))) * _ROUNDED_UP

    @property
    def brightest(self) -> float:
        """The most that a ray shows without reflection."""
        return max(self.background, float(self.receiver.max(initial=0.0)))


@dataclass(frozen=True)
class Budget:
    """What is left out although it is not absent: terms (receivers, lights), and mirrors deeper than `bounces`.

    The three bounds hold for every pixel; their sum is at most the tolerance.
    """

    diffuse: Truths
    specular: Truths
    bounces: int
    diffuse_bound: float
    specular_bound: float
    depth_bound: float


def brightness(measures: Measures, mirrors: Mirrors, lamps: Lamps) -> Brightness:
    """The bounds of everything that can add light."""
    materials = [measures.materials[k] for k in measures.material] + list(measures.plane_materials)
    strength = _strength(measures)
    intensity = np.array([colour(light.intensity) for light in measures.scene.lights], dtype=np.float64).reshape(
        1, -1, 3
    )

    def term(name: str, some: Truths) -> Floats:
        coefficient = np.array([colour(getattr(m, name)) for m in materials], dtype=np.float64).reshape(-1, 1, 3)
        with np.errstate(invalid="ignore", over="ignore"):
            product = coefficient * intensity * strength[:, :, np.newaxis] * _ROUNDED_UP
        return np.where(some[:, :, np.newaxis], np.nan_to_num(product, nan=0.0, posinf=np.inf), 0.0)

    diffuse, specular = term("diffuse", lamps.diffuse), term("specular", lamps.specular)
    ambient = np.array([colour(m.ambient) for m in materials], dtype=np.float64).reshape(-1, 3)
    background = measures.scene.background
    both = (background.bottom, background.top) if isinstance(background, Gradient) else (background,)
    shares = [material.reflect for material, used in zip(materials, mirrors.mirror, strict=True) if used]
    return Brightness(
        diffuse.max(axis=2, initial=0.0),
        specular.max(axis=2, initial=0.0),
        (ambient + (diffuse + specular).sum(axis=1)).max(axis=1, initial=0.0) * _ROUNDED_UP,
        max(channel for value in both for channel in colour(value)),
        max(shares, default=0.0),
    )


def _strength(measures: Measures) -> Floats:
    """(receivers, L): upper bound of the attenuation, at the least distance of the light from the receiver."""
    count, receivers = measures.count, measures.count + len(measures.plane_materials)
    result = np.ones((receivers, len(measures.at)))
    for number, light in enumerate(measures.scene.lights):
        if not isinstance(light, PointLight):
            continue
        least = np.zeros(receivers)
        gap = np.abs(norm(measures.center - measures.at[number]) - measures.radius)
        least[:count] = np.maximum(gap - 2.0**-40 * (gap + measures.radius), 0.0)
        if measures.normal is not None:
            height, error = measures.light_heights
            least[count:] = max(abs(float(height[number])) - float(error[number]), 0.0)
        a, b, c = light.attenuation
        far = least * measures.unit
        with np.errstate(divide="ignore", over="ignore"):
            result[:, number] = 1.0 / (a + b * far + c * far * far)
    return result


def spend(measures: Measures, mirrors: Mirrors, lamps: Lamps, max_error: float, force: Collection[str] = ()) -> Budget:
    """What fits a tolerance > 0, smallest bounds first."""
    bright = brightness(measures, mirrors, lamps)
    passed = bright.passed_on(mirrors.bounces)
    items: list[tuple[float, int, int, int]] = []  # bound, kind, receiver or depth, light
    for kind, (name, bounds, some) in enumerate(
        (("diffuse", bright.diffuse, lamps.diffuse), ("specular", bright.specular, lamps.specular))
    ):
        if name in force or "lights" in force:
            continue
        fitting = some & (bounds * passed <= max_error)
        items += [
            (float(bounds[r, light]) * passed, kind, int(r), int(light)) for r, light in np.argwhere(fitting).tolist()
        ]
    if not {"mirror", "mirror_depth"} & set(force):
        for depth in range(mirrors.bounces):
            rest = bright.passed_on(mirrors.bounces - depth - 1)
            items.append((bright.share ** (depth + 1) * bright.brightest * rest * _ROUNDED_UP, 2, depth, 0))
    left = (np.zeros_like(lamps.diffuse), np.zeros_like(lamps.specular))
    sums = (np.zeros(len(lamps.diffuse)), np.zeros(len(lamps.diffuse)))
    worst, bounces = [0.0, 0.0, 0.0], mirrors.bounces
    for bound, kind, receiver, light in sorted(items):
        if kind == 2:
            if receiver < bounces and (worst[0] + worst[1] + bound) * _ROUNDED_UP <= max_error:
                worst[2], bounces = bound, receiver
            continue
        grown = max(worst[kind], float(sums[kind][receiver]) + bound)
        if (worst[1 - kind] + worst[2] + grown) * _ROUNDED_UP <= max_error:
            worst[kind] = grown
            sums[kind][receiver] += bound
            left[kind][receiver, light] = True
    return Budget(left[0], left[1], bounces, worst[0], worst[1], worst[2])
