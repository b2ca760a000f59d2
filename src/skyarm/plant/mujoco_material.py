"""A material as numbers of MuJoCo's contact solver, so that it gives way as stiffly and slides as it does in ours.

MuJoCo's contact is a soft constraint. With the impedance d between 0 and 1, the distance r (negative inside), its
velocity v and the mean inverse mass A of both bodies, the force along the normal is f = (a_ref - a_0) / (A + R), where
R = A (1 - d) / d and a_ref = -b v - k r. With both numbers of ``solref`` negative, k = stiffness d / dmax^2 and
b = damping / dmax. Of an impedance near 1, a contact is nearly rigid and its stiffness is in proportion to the mass
that it meets. Of a small one R is all, and the contact is a spring and a damper of

    K = stiffness / (A (1 - d)),    D = damping / (A (1 - d))

at every posture: so d is the least that MuJoCo takes. Friction would be as soft; therefore ``impratio`` makes R smaller
by as much along the surface, and ``solreffriction`` gives the rate at which a slip is stopped.

Source: MuJoCo documentation, Computation, "Constraint model", and Modeling, "Solver parameters"; Todorov 2014.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from skyarm.contact.material import Material

IMPEDANCE = 1e-4
"""The least that MuJoCo takes (``mjMINIMP``). What mass and gravity add to the force is of this order."""

SLIP_STIFFER = 1e6
"""``impratio``: how much softer than along the surface a contact is along its normal. A load at half of the cone creeps
by 0.01 mm/s, measured."""

STOPPED = 0.5
"""Share of a slip that sticking friction stops in a step: one would overshoot."""

TOUCHING = 0.1
"""m/s, the speed of touching at which MuJoCo's damper takes as much energy as Hunt's and Crossley's."""


@dataclass(frozen=True, slots=True)
class ContactNumbers:
    """What MuJoCo is told of a pair of shapes: lists as its own fields."""

    friction: list[float]
    solref: list[float]
    solreffriction: list[float]
    solimp: list[float]


def mean_material(first: Material, second: Material) -> Material:
    """The material between two bodies that touch each other with skins of their own."""
    names = "stiffness", "dissipation", "friction", "bristle_length"
    return Material(**{name: 0.5 * (float(getattr(first, name)) + float(getattr(second, name))) for name in names})


def contact_numbers(material: Material, mobility: float, step: float) -> ContactNumbers:
    """The numbers of a pair.

    Args:
        material: of the contact.
        mobility: A, 1/kg: sum of ``body_invweight0`` of both bodies.
        step: s, of the integration.
    """
    stiffness, friction = float(material.stiffness), float(material.friction)
    scale = mobility * (1.0 - IMPEDANCE)
    damping = damping_of(material, 1.0 / mobility)
    return ContactNumbers(
        friction=[friction, friction, 0.0, 0.0, 0.0],
        solref=[-stiffness * scale, -damping * scale],
        # a distance along the surface is always 0: the stiffness is of no effect, but must be below 0
        solreffriction=[-1.0, -STOPPED / step * IMPEDANCE],
        solimp=_constant(IMPEDANCE),
    )


def damping_of(material: Material, mass: float) -> float:
    """N s/m of a linear damper beside the contact's spring that takes as much of a bounce as the material does.

    A Hunt-Crossley contact with the dissipation c leaves 1 - 2/3 c v of the speed v, a spring and damper with the
    damping ratio z leave exp(-pi z).
    """
    left = max(1.0 - 2.0 / 3.0 * float(material.dissipation) * TOUCHING, 0.05)
    return -2.0 * math.log(left) / math.pi * math.sqrt(float(material.stiffness) * mass)


def _constant(impedance: float) -> list[float]:
    """``solimp`` of an impedance that does not change with the depth."""
    width, middle, power = 0.001, 0.5, 2.0
    return [impedance, impedance, width, middle, power]


def mobility_of(inverse_weights: Sequence[Sequence[float]], bodies: Sequence[int]) -> float:
    """Mean inverse mass (1/kg) of a contact between bodies, as MuJoCo takes it from the first configuration."""
    return float(sum(inverse_weights[body][0] for body in bodies))
