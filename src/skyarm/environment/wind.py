"""Wind in two honest modes: a force and an air speed typed apart (RotorS), or an air velocity that causes drag."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from skyarm.algebra import ZERO3, Vec3
from skyarm.environment.dryden import Dryden
from skyarm.environment.effectiveness import Effectiveness
from skyarm.environment.gust import Gust


@dataclass(frozen=True, slots=True)
class WindSample:
    """What the vehicle feels of its surroundings at one instant.

    Attributes:
        force_W: force on the base, world axes, N.
        point_B: point of the base where it acts, base frame, m.
        air_velocity_W: velocity of the air that rotors and body drag see, world axes, m/s.
        effectiveness: what faults leave of the actuators (:mod:`skyarm.environment.faults`); None for whole ones.
    """

    force_W: Vec3 = ZERO3
    point_B: Vec3 = ZERO3
    air_velocity_W: Vec3 = ZERO3
    effectiveness: Effectiveness | None = None


@dataclass(frozen=True, kw_only=True, slots=True)
class RotorsForce:
    """Wind as RotorS's plugin takes it: newtons and metres per second are independent inputs.

    Attributes:
        force_W: mean force on the base, world axes, N.
        point_B: where mean and gust force act, base frame, m.
        air_velocity_W: constant wind that the rotors feel, m/s. A gust never changes it.
        gust: additional force, N, a step.
    """

    force_W: Vec3 = ZERO3
    point_B: Vec3 = ZERO3
    air_velocity_W: Vec3 = ZERO3
    gust: Gust | None = None

    def __post_init__(self) -> None:
        if self.gust is not None and self.gust.shape != "step":
            raise ValueError(f"gust.shape = {self.gust.shape!r}: a gust of force is a 'step' as in RotorS")

    def sample(self, t: Any, turbulence_W: Vec3 = ZERO3) -> WindSample:
        """Wind at time t (s); RotorS has no turbulence, so that is ignored.

        Source: RotorS, gazebo_wind_plugin.cpp lines 137-177.
        """
        force = self.force_W if self.gust is None else self.force_W + self.gust.at(t)
        return WindSample(force, self.point_B, self.air_velocity_W)


@dataclass(frozen=True, kw_only=True, slots=True)
class Airspeed:
    """Moving air: rotor and body drag are computed from its velocity, there is no direct force.

    Attributes:
        velocity_W: mean air velocity, world axes, m/s.
        gust: additional air velocity, m/s.
        turbulence: parameters of the Dryden model whose samples are given to :func:`wind`; None for smooth air.
    """

    velocity_W: Vec3 = ZERO3
    gust: Gust | None = None
    turbulence: Dryden | None = None

    def sample(self, t: Any, turbulence_W: Vec3 = ZERO3) -> WindSample:
        """Wind at time t (s): mean + gust + turbulence."""
        velocity = self.velocity_W if self.gust is None else self.velocity_W + self.gust.at(t)
        return WindSample(air_velocity_W=velocity + turbulence_W)


Wind = RotorsForce | Airspeed

NO_WIND = Airspeed()
"""Calm air: every component is a structural zero and folds away."""


def wind(par: Wind, t: Any, turbulence_W: Vec3 = ZERO3) -> WindSample:
    """Sample what the vehicle feels of the wind at time t.

    Args:
        par: one of the two modes.
        t: s; may be traced.
        turbulence_W: velocity from :func:`skyarm.environment.dryden.step`, world axes, m/s; only ``Airspeed`` adds it.
    """
    return par.sample(t, turbulence_W)
