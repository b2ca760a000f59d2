"""What a vehicle feels of one component of its surroundings, as one record: for tests of winds."""

from __future__ import annotations

from typing import Any

from skyarm.algebra import ZERO3, Quaternion, Sym3, Vec3
from skyarm.dynamics import State
from skyarm.dynamics.point_motion import PointMotion
from skyarm.vehicle import Body, Vehicle
from skyarm.vehicle.linkage import BASE
from skyarm.world import Component, WindSample

_ANYTHING = Vehicle(name="anything", base=Body(mass=1.0, inertia=Sym3.isotropic(0.01)))
_REST = State(
    position=ZERO3,
    quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
    velocity=ZERO3,
    rate=ZERO3,
    joints=(),
    joint_rates=(),
    rotor_speeds=(),
)


def wind(par: Component, t: Any, memory: Any = ()) -> WindSample:
    """Force on the base with its point, and velocity of the air at the origin, at time t (s; array or traced)."""
    wrenches = par.wrenches(memory, t, PointMotion(_ANYTHING, _REST), ())
    assert len(wrenches) <= 1
    force, point = ZERO3, ZERO3
    for wrench in wrenches:
        assert wrench.body == BASE
        assert wrench.torque_W == ZERO3
        force, point = wrench.force_W, wrench.point
    return WindSample(force, point, par.velocity(memory, t, Vec3(3.0, -2.0, 7.0)))
