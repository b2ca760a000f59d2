"""Initial deflections of friction bristles, for bodies that stand at rest: friction
balances the tangential weight.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from skyarm.algebra import E_Z, ZERO3, Scalar, Vec3
from skyarm.algebra.scalars import divide, maximum, minimum, sqrt
from skyarm.world.contact.material import Material
from skyarm.world.contact.meetings import Meeting

_NOTHING = 1e-12
"""Small force (N) or length (m) added in a denominator."""


def standing_bristles(
    meetings: Sequence[Meeting],
    bristles: Sequence[Vec3],
    weights: Mapping[int, Scalar],
    materials: Mapping[str, Material],
) -> tuple[Vec3, ...]:
    """Initial bristle deflections (m) with which friction balances the weight of each
    standing body, as far as it can.

    Args:
        meetings: contacts at the start.
        bristles: deflection of the bristle of each of them, m, world axes.
        weights: weights of the bodies that stand, N, by number; that of the vehicle by
            ``NOBODY``.
        materials: materials of the surfaces, by name.
    """
    bent = list(bristles)
    for by, weight in weights.items():
        force = ZERO3
        pressed: Scalar = 0.0
        for each in meetings:
            if each.by == by:
                force = force + each.touch.axis * each.touch.normal
                pressed = pressed + each.touch.normal
        across = E_Z * weight - force
        for i, each in enumerate(meetings):
            if each.by == by:
                material = materials[each.surface]
                # a bristle lies in its surface: what is along the normal it cannot bear
                borne = across - each.touch.axis * across.dot(each.touch.axis)
                deflection = borne * -divide(
                    material.bristle_length,
                    maximum(material.friction * pressed, _NOTHING),
                )
                size = sqrt(deflection.dot(deflection) + _NOTHING * _NOTHING)
                # no longer than its length, or it would spring back at the first step
                share = minimum(divide(material.bristle_length, size), 1.0)
                bent[i] = Vec3(*(c * share for c in deflection))
    return tuple(bent)
