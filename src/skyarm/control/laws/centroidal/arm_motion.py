"""How much of the arm's motion the base makes good.

A base that stays on its reference while the arm swings must move the common centre of mass, h(th_d) in base axes, and
tilt for it: the arm's motion asks for the angular acceleration |h''''| / g. Fast swings ask for more than rotors give;
then the centre of mass follows only a share of them, the base gives way by the rest, and the tip, which the arm holds,
does not. The share is limit / size where the size of |h''''| / g, followed quickly upwards and slowly downwards, is
above the limit, else 1; what is left out is the motion about a slow mean of h. Vertical motion needs no tilt and stays.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.algebra import Vec3
from skyarm.control.blocks.select import vector_data
from skyarm.control.blocks.series_kinematics import derivative
from skyarm.records.units import Unit
from skyarm.scalars import Scalar, divide, minimum, sqrt, where

ATTACK, DECAY = 10.0, 0.5
"""1/s, rates at which the size follows upwards and downwards."""

MEAN = 1.0
"""rad/s, filter of the mean."""

SMALL = 1e-9


@dataclass(frozen=True, kw_only=True, slots=True)
class ArmMotion:
    """Memory.

    Attributes:
        size: of the angular acceleration that the arm's motion asks for, rad/s^2. mean: of h, base axes, m.
    """

    size: Annotated[Scalar, Unit("rad/s^2", "angular acceleration that the arm's motion asks for")]
    mean: Annotated[Vec3, Unit("m", "slow mean of the common centre of mass, base axes")]


def followed(memory: ArmMotion, com: Vec3, gravity: Any, dt: Any) -> ArmMotion:
    """The memory one period later; ``com`` is h as a series of fourth order."""
    top = derivative(com, 4)
    size = divide(sqrt(top.x * top.x + top.y * top.y), gravity)
    rate = where(size > memory.size, ATTACK, DECAY) * dt
    h = derivative(com, 0)
    return ArmMotion(
        size=memory.size + rate * (size - memory.size), mean=vector_data(memory.mean + (h - memory.mean) * (MEAN * dt))
    )


def made_good(memory: ArmMotion, limit: Any, h: list[Vec3]) -> list[Vec3]:
    """h and its derivatives as the centre of mass follows them, base axes; the mean moves as its filter says."""
    left = 1.0 - minimum(1.0, divide(limit, memory.size + SMALL))
    mean = [memory.mean]
    for each in h[:-1]:
        mean.append((each - mean[-1]) * MEAN)
    return [Vec3(a.x - (a.x - m.x) * left, a.y - (a.y - m.y) * left, a.z) for a, m in zip(h, mean, strict=True)]
