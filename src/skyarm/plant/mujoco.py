"""The second plant: MuJoCo's rigid bodies under the same rotors, wind and joint drives; no shared rigid-body code.

Only the length of a step where joint friction is stiff comes from our own mass matrix (:mod:`skyarm.plant.stiffness`).
"""

from __future__ import annotations

import math
import threading
import warnings
from collections.abc import Sequence
from typing import Any

import mujoco

from skyarm.actuation import Command
from skyarm.algebra import Quaternion, Vec3
from skyarm.compile.quick import Quick
from skyarm.dynamics.state import State
from skyarm.environment import WindSample
from skyarm.plant.interface import Flat, World, number, whole_steps
from skyarm.plant.loads import applied_force, lagged
from skyarm.plant.mujoco_model import INTEGRATORS, build_spec, joint_addresses
from skyarm.plant.stiffness import friction_rate
from skyarm.vehicle.check import require_plant

FRICTION_STEP = 0.1
"""Largest product of friction's decay rate and a step: held forces make friction first order, 5 % off at 0.1."""


class _Quiet:
    """While any plant steps, MuJoCo's warnings go nowhere: they print, and write a log file beside the user's work.

    An episode that diverges says so itself. MuJoCo has one handler for all threads; the caller's comes back.
    """

    def __init__(self) -> None:
        self._lock, self._inside, self._usual = threading.Lock(), 0, None

    def __enter__(self) -> None:
        with self._lock:
            if self._inside == 0:
                self._usual = mujoco.get_mju_user_warning()
                mujoco.set_mju_user_warning(_ignore)
            self._inside += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._inside -= 1
            if self._inside == 0:
                mujoco.set_mju_user_warning(self._usual)


def _ignore(_message: str) -> None:
    pass


QUIET = _Quiet()


class MujocoPlant:
    """MuJoCo steps the bodies; forces are those of :mod:`skyarm.plant.loads`, held for each physics step.

    Held forces make every integrator a method of first order in ``physics_step``. Not for two threads at once: each
    call works in the same MuJoCo data, though nothing in it outlives the call.

    Args:
        world: true vehicle and gravity. A planar model is refused: no real body has its inertia.
        wind: a sample of the episode's wind; its structural zeros are folded away.
        integrator: MuJoCo's "rk4" or (semi-implicit) "euler".
        physics_step: s; "rk4" takes shorter steps where joint friction, held for a step, would be stiff.
    """

    def __init__(self, world: World, wind: WindSample, integrator: str = "rk4", physics_step: float = 0.001) -> None:
        require_plant(world.vehicle)
        if integrator not in INTEGRATORS:
            raise ValueError(f"integrator = {integrator!r}: must be one of {list(INTEGRATORS)}")
        self.vehicle = world.vehicle
        if integrator == "rk4":
            physics_step /= max(1, math.ceil(friction_rate(world.vehicle) * physics_step / FRICTION_STEP))
        spec = build_spec(world.vehicle, float(world.gravity), timestep=physics_step, integrator=integrator)
        with QUIET, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of masses beyond measure, whose flight ends as diverged
            self.model = spec.compile()
        self._physics_step, self._rk4 = physics_step, integrator == "rk4"
        self._data = mujoco.MjData(self.model)
        self._qpos, self._qvel, self._force = self._data.qpos, self._data.qvel, self._data.qfrc_applied
        self._nq, self._nv = self.model.nq, self.model.nv
        self._rotors = len(world.vehicle.rotors)
        self._to_mujoco, self._from_mujoco = self._orders()
        zeros = (0.0,) * (self._nq + self._nv + self._rotors)
        efforts = (0.0,) * world.vehicle.n
        self._loads = Quick(self._forces_and_speeds, zeros, (0.0,) * self._rotors, efforts, wind)

    def _orders(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Permutations of a flat state: ours to [qpos, qvel, rotor speeds] and back."""
        nq = self._nq
        q, v = joint_addresses(self.vehicle, self.model)
        speeds = range(nq + self._nv, nq + self._nv + self._rotors)
        # ours is position, quaternion, velocity, rate, joints, joint rates, rotor speeds
        back = [*range(7), *(nq + i for i in range(6)), *q, *(nq + i for i in v), *speeds]
        there = sorted(range(len(back)), key=back.__getitem__)
        return tuple(there), tuple(back)

    def _state(self, x: Sequence[Any]) -> State:
        """State record from numbers in MuJoCo's order."""
        ours = [x[i] for i in self._from_mujoco]
        n = self.vehicle.n
        return State(
            position=Vec3.of(ours[0:3]),
            quaternion=Quaternion.of(ours[3:7]),
            velocity=Vec3.of(ours[7:10]),
            rate=Vec3.of(ours[10:13]),
            joints=tuple(ours[13 : 13 + n]),
            joint_rates=tuple(ours[13 + n : 13 + 2 * n]),
            rotor_speeds=tuple(ours[13 + 2 * n :]),
        )

    def _forces_and_speeds(self, x: Any, commanded: Any, efforts: Any, wind: WindSample) -> Any:
        """Generalised forces in MuJoCo's order and the rotor speeds after one physics step.

        The dual of a free joint's velocity is the force at the base origin in world axes and the torque in base axes.
        """
        state = self._state(x)
        force, torques = applied_force(self.vehicle, state, state.rotor_speeds, efforts, wind)
        command = Command(rotor_speeds=commanded, efforts=efforts)
        generalized: list[Any] = [*state.quaternion.rotation().apply(force.force), *force.torque, *torques]
        _, dofs = joint_addresses(self.vehicle, self.model)
        place = [*range(6), *dofs]
        ordered = [generalized[i] for i in sorted(range(self._nv), key=place.__getitem__)]
        return tuple(number(value) for value in (*ordered, *lagged(self.vehicle, state, command, self._physics_step)))

    def advance(self, state: Flat, command: Flat, wind: Flat, seconds: float) -> tuple[float, ...]:
        """State after ``seconds`` (whole physics steps) of held command and wind; a diverged state stays diverged."""
        self._set(state, command, wind)
        model, data, step, outputs = self.model, self._data, self._loads.step, self._loads.outputs
        split, end = self._nq + self._nv, self._nq + self._nv + self._rotors
        qpos, qvel, speeds = (self._loads.inputs[a:b] for a, b in ((0, self._nq), (self._nq, split), (split, end)))
        forces, turned = outputs[: self._nv], outputs[self._nv :]
        with QUIET:
            for _ in range(whole_steps(seconds, self._physics_step)):
                step()
                self._force[:] = forces
                # mj_step without its checks: the monitor of the episode says what went wrong
                mujoco.mj_forward(model, data)
                if self._rk4:
                    mujoco.mj_RungeKutta(model, data, 4)
                else:
                    mujoco.mj_Euler(model, data)
                qpos[:], qvel[:], speeds[:] = self._qpos, self._qvel, turned
        x = self._loads.inputs[:end].tolist()
        return tuple([x[i] for i in self._from_mujoco])

    def _set(self, state: Flat, command: Flat, wind: Flat) -> None:
        """Numbers of an instant to where MuJoCo and the loads read them."""
        x = [state[i] for i in self._to_mujoco]
        self._qpos[:], self._qvel[:] = x[: self._nq], x[self._nq : self._nq + self._nv]
        self._loads.inputs[:] = (*x, *command, *wind)

    def specific_force(self, state: Flat, command: Flat, wind: Flat) -> tuple[float, float, float]:
        """Proper acceleration of the base origin, base axes, m/s^2: the free joint's acceleration plus g."""
        self._set(state, command, wind)
        self._loads.step()
        self._force[:] = self._loads.outputs[: self._nv]
        with QUIET:
            mujoco.mj_forward(self.model, self._data)
        proper_W = self._data.qacc[:3] - self.model.opt.gravity
        fx, fy, fz = (self._data.xmat[1].reshape(3, 3).T @ proper_W).tolist()
        return fx, fy, fz
