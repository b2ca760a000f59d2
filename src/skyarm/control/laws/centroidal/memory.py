"""Memory of the centroidal law."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.algebra import Vec3
from skyarm.algebra.scalars import Scalar
from skyarm.control.blocks.disturbance_observer import Observed
from skyarm.control.blocks.extrapolation import Channel
from skyarm.control.laws.centroidal.demands import Following
from skyarm.control.laws.centroidal.gust_shift import GustMemory
from skyarm.dynamics.actuators import Command
from skyarm.records.units import Unit


@dataclass(frozen=True, kw_only=True, slots=True)
class PartMemories:
    """Memory of each part of :class:`Parts`; empty for one that is left out."""

    lag: Any = ()
    interaction: Any = ()
    admittance: Any = ()
    load: Any = ()
    trend: Any = ()
    adaptation: Any = ()


@dataclass(frozen=True, kw_only=True, slots=True)
class CentroidalMemory:
    """State of the law between two steps.

    Attributes:
        channels: samples of x, y, z, yaw and joints.
        sent: the last commands, oldest first, one more than the delay has periods.
        gust: rate of the slow force; empty without the shift for gusts.
        following: of the demands. parts: of the parts.
    """

    started: Annotated[Scalar, Unit("", "0 before the first measurement")]
    age: Annotated[Scalar, Unit("s", "since the held reference sample appeared")]
    channels: tuple[Channel, ...]
    observed: Observed
    sent: tuple[Command, ...]
    applied: Annotated[tuple[Scalar, ...], Unit("", "1 for rotors and joints whose last command was applied unchanged")]
    free: Annotated[tuple[Scalar, ...], Unit("", "1 for base and joints whose actuators are not at their limit")]
    slow_force: Annotated[Vec3, Unit("N", "the observer's force, slowly filtered")]
    trim: Annotated[tuple[Scalar, ...], Unit("(rad/s)^2", "added to the squared speeds that the mixer asks for")]
    gust: GustMemory | tuple[()] = ()
    following: Following = Following()
    parts: PartMemories = PartMemories()
