"""Positions and velocities of points on a vehicle in the world, for models of external
forces.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

from skyarm.algebra import ZERO3, Force, Mat3, Motion, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import add
from skyarm.dynamics.kinematics import Pose, jacobian_columns, link_poses
from skyarm.dynamics.state import State
from skyarm.vehicle import BASE, Frame, Vehicle


class PointMotion:
    """Positions and velocities of points on the bodies of a vehicle, computed on
    demand.

    Args:
        vehicle: bodies of the points. state: state of the vehicle; it may be traced.
        air: velocity of the air (m/s) at a place (m), world axes; calm if left out.
        gravity: m/s^2, for what falls beside the vehicle; none if left out.
        step: s, of a method that takes forces once in the middle of its step; None of
            others.
        name: name of the vehicle.

    Attributes:
        agents: motions of all vehicles by name, that of this one among them.
        task_time: time (s) of the events of its task, at a control instant. time: of
            the flight then; None elsewhere.
        solids: surfaces at rest on which a load on a cord lies down, at a control
            instant.
        rotor_shares: share of each rotor's forces that faults leave.
    """

    task_time: Scalar = 0.0
    time: Scalar | None = None
    solids: tuple[Any, ...] = ()

    def __init__(
        self,
        vehicle: Vehicle,
        state: State,
        air: Callable[[Vec3], Vec3] | None = None,
        *,
        gravity: Scalar = 0,
        step: Scalar | None = None,
        name: str = "",
    ) -> None:
        self.vehicle = vehicle
        self.state = state
        self._air = air
        self.gravity = gravity
        self.step = step
        self.name = name
        self.agents: Mapping[str, PointMotion] = {name: self}
        # ints: without faults the factor folds away
        self.rotor_shares: Scalars = (1,) * len(vehicle.rotors)

    def of(self, agent: str) -> PointMotion:
        """Motion of a vehicle by name; this one for an empty name, or where vehicles
        have none.
        """
        return self.agents[agent] if agent and self.name else self

    def with_places(self, places: Sequence[tuple[Vec3, Scalars]]) -> PointMotion:
        """Motion of all vehicles with other positions (m) and joints (rad or m), in the
        order of ``agents``.
        """
        moved = dict[str, PointMotion]()
        for (name, each), place in zip(self.agents.items(), places, strict=True):
            state = replace(each.state, position=place[0], joints=place[1])
            moved[name] = PointMotion(
                each.vehicle, state, gravity=each.gravity, step=each.step, name=name
            )
            # one dictionary: each sees the others where they were placed
            moved[name].agents = moved
        return moved[self.name]

    def air_velocity(self, point: Vec3 = ZERO3, body: int = BASE) -> Vec3:
        """World velocity of the air at a point given in a body's frame, m/s."""
        return ZERO3 if self._air is None else self._air(self.position(point, body))

    @cached_property
    def rotation(self) -> Mat3:
        """Rotation matrix R_WB of the base, from base axes to world axes."""
        return self.state.rotation

    @cached_property
    def _links(self) -> Sequence[Pose]:
        return link_poses(self.vehicle, self.state.joints)

    def _columns(self, point: Vec3, body: int) -> list[Motion]:
        """Jacobian of a point on a body by the joint rates, one column per joint."""
        return jacobian_columns(
            self.vehicle,
            Frame(name="point", link=body, position=point),
            self.state.joints,
        )

    def _in_base(self, point: Vec3, body: int) -> Vec3:
        return point if body == BASE else self._links[body].apply(point)

    def position(self, point: Vec3 = ZERO3, body: int = BASE) -> Vec3:
        """World position of a point given in a body's frame, m."""
        return self.state.position + self.rotation.apply(self._in_base(point, body))

    def velocity(self, point: Vec3 = ZERO3, body: int = BASE) -> Vec3:
        """World velocity of a point given in a body's frame, m/s."""
        moving = self.state.rate.cross(self._in_base(point, body))
        if body != BASE:
            columns = self._columns(point, body)
            for column, rate in zip(columns, self.state.joint_rates, strict=True):
                moving = moving + column.linear * rate
        return self.state.velocity + self.rotation.apply(moving)

    def angular_velocity(self, body: int = BASE) -> Vec3:
        """Angular velocity of a body in its own axes, rad/s."""
        if body == BASE:
            return self.state.rate
        total = self.state.rate
        columns = self._columns(ZERO3, body)
        for column, rate in zip(columns, self.state.joint_rates, strict=True):
            total = total + column.angular * rate
        return self._links[body].R.apply_T(total)

    def to_world(self, vector: Vec3, body: int = BASE) -> Vec3:
        """Rotate a vector from a body's axes to world axes."""
        return self.rotation.apply(
            vector if body == BASE else self._links[body].R.apply(vector)
        )

    def frame(self, name: str | None = None) -> tuple[Vec3, int]:
        """Position (m) of a named frame on its body, and the body's index; the tip by
        default.
        """
        frame = self.vehicle.frame(name)
        return frame.position, frame.link

    def generalized_force(
        self, force_W: Vec3, torque_W: Vec3, point: Vec3, body: int
    ) -> tuple[Force, Scalars]:
        """Generalised force of a wrench on a body (J^T w): force on the base and joint
        torques.
        """
        push, twist = self.rotation.apply_T(force_W), self.rotation.apply_T(torque_W)
        at = self._in_base(point, body)
        total = Force(at.cross(push) + twist, push)
        if body == BASE:
            # a force on the base moves no joint: zeros of structure
            return total, (0,) * self.vehicle.n
        columns = self._columns(point, body)
        return total, tuple(
            add(c.linear.dot(push), c.angular.dot(twist)) for c in columns
        )
