"""Plans and planning tasks that several tests share, and the motion of a plan by
MuJoCo's dynamics.

The vehicle is bound by MuJoCo's mass matrix and bias force; pushes of rotors and of a
contact are written anew here.
"""

from __future__ import annotations

import copy
import tomllib
from functools import cache
from typing import Any

import mujoco
import numpy as np

from skyarm.planning.planner import Plan, plan
from skyarm.planning.stage import ARM_UNIT, JERK_UNIT, SPIN_UNIT, PlanStage
from skyarm.planning.task import load_task, task_from
from skyarm.plant.mujoco_model import build_spec, joint_addresses
from skyarm.vehicle import BASE, Vehicle

_REACH = tomllib.loads("""
schema = 1
name = "reach"
vehicle = "hexacopter370_flying_arm_3"

[start]
position = [0.0, 0.0, 1.0]

[[phases]]
name = "approach"
to = { tip = [1.0, 0.0, 1.0] }
duration = 1.0

[[phases]]
name = "grasp"
kind = "hold"
duration = 0.2

[[phases]]
name = "away"
to = { base = [2.0, 0.0, 1.5], heading = 0.0, joints = [0.0, 0.0, 0.0], rest = true }
duration = 1.2
""")


def reach(**changes: Any) -> dict[str, Any]:
    """Table of a task of 2.4 s: the tip rests 1 m ahead for a moment. ``a__0__b =
    value`` is entry ``b`` of ``a[0]``.

    A value of None leaves the entry out.
    """
    table = copy.deepcopy(_REACH)
    for path, value in changes.items():
        *tables, last = path.split("__")
        at: Any = table
        for word in tables:
            at = at[int(word)] if isinstance(at, list) else at.setdefault(word, {})
        key: Any = int(last) if isinstance(at, list) else last
        if value is None:
            del at[key]
        else:
            at[key] = value
    return table


def box(position: list[float], size: list[float], **fields: Any) -> dict[str, Any]:
    """Table of an obstacle."""
    return {"shape": "box", "position": position, "size": size, **fields}


@cache
def catch() -> Plan:
    """Plan of the shipped eagle catch; each process makes it once."""
    return plan(load_task("eagle_catch"))


def planned(**changes: Any) -> Plan:
    """Plan of a changed task of :func:`reach`."""
    return plan(task_from(reach(**changes)))


class Bodies:
    """A vehicle in MuJoCo whose joints have prescribed accelerations."""

    def __init__(self, vehicle: Vehicle, gravity: float = 9.81) -> None:
        spec = build_spec(vehicle, gravity)
        names = {BASE: spec.worldbody.bodies[0].name} | {
            i: link.name for i, link in enumerate(vehicle.moving)
        }
        tip = vehicle.frame(vehicle.end_effector)
        spec.body(names[tip.link]).add_site(
            name="grip", pos=[*map(float, tip.position)]
        )
        self.vehicle, self.model = vehicle, spec.compile()
        self.data = mujoco.MjData(self.model)
        self.q, self.v = joint_addresses(vehicle, self.model)
        self.site, self.base = (
            self.model.site("grip").id,
            self.model.body(names[BASE]).id,
        )

    def place(self, x: np.ndarray) -> None:
        """Set the state: position, quaternion, velocity, body rate, joints, joint
        rates, as a plan orders them.
        """
        n = self.vehicle.n
        self.data.qpos[:7], self.data.qpos[self.q] = x[:7], x[13 : 13 + n]
        self.data.qvel[:6], self.data.qvel[self.v] = x[7:13], x[13 + n : 13 + 2 * n]
        mujoco.mj_forward(self.model, self.data)

    def tip(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position (m) and velocity (m/s) of the tip in world axes."""
        self.place(x)
        return (
            self.data.site_xpos[self.site].copy(),
            self._tip_jacobian() @ self.data.qvel,
        )

    def _tip_jacobian(self) -> np.ndarray:
        J = np.zeros((3, self.model.nv))
        mujoco.mj_jacSite(self.model, self.data, J, None, self.site)
        return J

    def accelerations(
        self, x: np.ndarray, speeds: np.ndarray, joints: np.ndarray, push: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Accelerations of MuJoCo's velocities, and the joint efforts (N m or N) that
        they take.

        Args:
            x: state. speeds: of the rotors, rad/s. joints: accelerations. push: force
                on the tip, N, world axes.
        """
        self.place(x)
        R, at = self.data.xmat[self.base].reshape(3, 3), self.data.xpos[self.base]
        applied = self._tip_jacobian().T @ push
        for rotor, speed in zip(self.vehicle.rotors, speeds, strict=True):
            thrust = (
                float(rotor.thrust_coefficient)
                * speed**2
                * np.array([*map(float, rotor.axis)])
            )
            drag = -float(rotor.direction) * float(rotor.moment_coefficient) * thrust
            place = R @ np.array([*map(float, rotor.position)])
            force, torque, out = R @ thrust, R @ drag, np.zeros(self.model.nv)
            mujoco.mj_applyFT(
                self.model, self.data, force, torque, at + place, self.base, out
            )
            applied = applied + out
        M = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, self.data, M)
        a = np.zeros(self.model.nv)
        a[self.v] = joints
        left = applied - self.data.qfrc_bias - M @ a
        free = [i for i in range(self.model.nv) if i not in self.v]
        a[free] = np.linalg.solve(M[np.ix_(free, free)], left[free])
        return a, (M @ a + self.data.qfrc_bias - applied)[self.v]

    def step(
        self,
        x: np.ndarray,
        u: np.ndarray,
        push: np.ndarray,
        stage: PlanStage,
        dt: float,
    ) -> np.ndarray:
        """State of a plan after a time: one Runge-Kutta step, its quaternion normalised
        at the end.

        Args:
            x: state, as a plan has it. u: inputs. push: force on the tip, N, world
                axes. stage: of the plan. dt: s.
        """
        n, m = self.vehicle.n, len(self.vehicle.rotors)
        speeds, rates = (
            slice(13 + 2 * n, 13 + 2 * n + m),
            slice(13 + 2 * n + m, 13 + 3 * n + m),
        )
        spin, jerk = u[:m] * SPIN_UNIT, u[m : m + n] * (JERK_UNIT / ARM_UNIT)

        def slope(at: np.ndarray) -> np.ndarray:
            joints = at[rates] * ARM_UNIT
            a, _ = self.accelerations(
                at, at[speeds] * np.array(stage.hover), joints, push
            )
            turned = 0.5 * product(at[3:7], np.array([0.0, *at[10:13]]))
            rest = np.zeros(len(at) - rates.stop)
            return np.concatenate(
                [
                    at[7:10],
                    turned,
                    a[:6],
                    at[13 + n : 13 + 2 * n],
                    joints,
                    spin,
                    jerk,
                    rest,
                ]
            )

        k1 = slope(x)
        k2 = slope(x + 0.5 * dt * k1)
        k3 = slope(x + 0.5 * dt * k2)
        k4 = slope(x + dt * k3)
        after = x + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        after[3:7] /= np.linalg.norm(after[3:7])
        return after


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Product of two quaternions, scalar first."""
    w, v = (
        a[0] * b[0] - a[1:] @ b[1:],
        a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:]),
    )
    return np.array([w, *v])


def between_nodes(found: Plan, bodies: Bodies, k: int, parts: int) -> list[np.ndarray]:
    """States of stage ``k`` of a plan without contact, from node to node by small steps
    of MuJoCo's dynamics.
    """
    rows, dt = [found.x[k]], (found.t[k + 1] - found.t[k]) / parts
    for _ in range(parts):
        rows.append(bodies.step(rows[-1], found.u[k], np.zeros(3), found.stage, dt))
    return rows
