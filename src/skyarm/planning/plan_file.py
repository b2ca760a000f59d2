"""File of a plan, and the scenario that flies it."""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from skyarm.algebra import Quaternion
from skyarm.dynamics.array_front import center_of_mass, frame_pose_world
from skyarm.planning.planner import Plan
from skyarm.records.arrays import doubles
from skyarm.reference.planned_motion import FORMAT


def plan_arrays(plan: Plan) -> dict[str, Any]:
    """Arrays of a plan: states and inputs at the nodes, and what a reference needs of
    them; the vehicle's name.

    ``t`` s; ``position``, ``center``, ``tip`` (N + 1, 3) m, world axes; ``yaw`` rad;
    ``joints``, ``joint_rates``; ``quaternion`` (N + 1, 4); ``velocity``, ``rate``;
    ``rotor_speeds`` rad/s; ``inputs`` (N, nu); ``torques`` (N + 1, n) N m or N, of the
    joints; ``gains`` (N, nu, nt); ``phase`` (N + 1,) index; ``force`` (N + 1, 3) N, of
    a contact on the tip.
    """
    vehicle = plan.task.vehicle
    x = plan.x
    at = plan.stage.at
    joints = x[:, at.joints]
    R = Quaternion(*x[:, 3:7].T).rotation()
    center = center_of_mass(vehicle, x[:, :3], x[:, 3:7], joints)
    tip = np.zeros((len(x), 0))
    if vehicle.end_effector:
        tip = frame_pose_world(vehicle, x[:, :3], x[:, 3:7], joints)[0]
    # heading of the attitude whose body y is across it, as the laws build theirs
    yaw = np.unwrap(np.arctan2(-doubles(R.rows[0].y), doubles(R.rows[1].y)))
    force = np.zeros((len(x), 3))
    edges = plan.edges
    phase = np.clip(
        np.searchsorted(edges, np.arange(len(x)), side="right") - 1, 0, len(edges) - 2
    )
    if plan.stage.contact:
        pushed = [plan.task.phases[k].contact is not None for k in phase[:-1]]
        force[:-1] = plan.u[:, -3:] * plan.stage.weight * np.array(pushed)[:, None]
    return {
        "format": FORMAT,
        "vehicle": vehicle.name,
        "t": plan.t,
        "position": x[:, :3],
        "center": center,
        "tip": tip,
        "yaw": yaw,
        "joints": joints,
        "joint_rates": x[:, at.joint_rates],
        "quaternion": x[:, 3:7],
        "velocity": x[:, 7:10],
        "rate": x[:, 10:13],
        "rotor_speeds": plan.rotor_speeds,
        "torques": plan.torques,
        "inputs": plan.u,
        "gains": plan.K,
        "phase": phase,
        "force": force,
    }


def plan_bytes(plan: Plan) -> bytes:
    """Content of a plan's file, the same bytes for the same plan."""
    buffer = io.BytesIO()
    np.savez(buffer, **plan_arrays(plan))
    return buffer.getvalue()
