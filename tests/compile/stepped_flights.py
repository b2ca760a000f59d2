"""Two stepped programs of the engines' tests: a damped pendulum with noise, and a
vehicle under its controller.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

import skyarm
from skyarm.algebra import Quaternion, Vec3
from skyarm.algebra.scalars import cos, log, philox, sin, sqrt
from skyarm.control.catalogue import preset
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.plant.interface import Truth
from skyarm.plant.rigid_body import coupled_euler, coupled_rk4
from skyarm.records.leaves import leaves
from skyarm.reference import Constant, Reference, Sine, Trajectory
from skyarm.sensing.measurement import Measurement
from support.one_vehicle import after_step
from support.vehicles import steady_wind

PERIOD = 0.005


@dataclass(frozen=True, kw_only=True)
class Pendulum:
    angle: Any
    rate: Any


@dataclass(frozen=True, kw_only=True)
class Constants:
    stiffness: Any
    damping: Any
    noise: Any


PENDULUM = Pendulum(angle=0.4, rate=-0.2)
CONSTANTS = Constants(stiffness=9.0, damping=0.3, noise=0.5)
DRAWS = ((3, 2), (7, 1))
"""Two numbers of channel 3 and one of channel 7."""


def pendulum_step(at: Pendulum, par: Constants, row: Any, draws: Any) -> Any:
    """One semi-implicit step with torque row[0] and a normal and a uniform
    disturbance.
    """
    a, b, c = draws
    push = par.noise * (sqrt(-2.0 * log(a)) * cos(6.283185307179586 * b) + (c - 0.5))
    rate = at.rate + 0.01 * (
        push + row[0] - par.stiffness * sin(at.angle) - par.damping * at.rate
    )
    return Pendulum(angle=at.angle + 0.01 * rate, rate=rate), (rate, push)


TRUTH = skyarm.load_vehicle("hummingbird_arm2_rotors")
CONTROLLER = preset(
    "paper_ct", Model(vehicle=skyarm.load_vehicle("hummingbird_arm2"), gravity=9.81)
)
FLOWN = Truth(vehicle=TRUTH, gravity=9.8)
FLIGHT = Trajectory(
    x=Sine(amplitude=0.3, frequency_hz=0.5),
    z=Constant(1.0),
    yaw=Constant(0.1),
    joints=(
        Sine(amplitude=0.3, frequency_hz=1.0),
        Sine(amplitude=0.2, frequency_hz=0.7),
    ),
)
TILTED = State(
    position=Vec3(0.02, -0.03, 1.05),
    quaternion=Quaternion(0.99, 0.1, -0.05, 0.02).normalized(),
    velocity=Vec3(0.1, 0.0, -0.1),
    rate=Vec3(0.2, -0.1, 0.05),
    joints=(0.05, -0.1),
    joint_rates=(0.0, 0.2),
    rotor_speeds=(485.0,) * 4,
)


def flight_step(
    state: State,
    par: Any,
    reference: Reference,
    draws: Any,
    integrate: Any = coupled_rk4,
) -> Any:
    """One control period: perfect measurement, the law, one step of the plant."""
    del draws
    seen = Measurement(
        time=0.0,
        position=state.position,
        velocity=state.velocity,
        quaternion=state.quaternion,
        rate=state.rate,
        specific_force=Vec3(0.0, 0.0, 9.81),
        joints=state.joints,
        joint_rates=state.joint_rates,
        rotor_speeds=state.rotor_speeds,
    )
    _, command = CONTROLLER.law((), seen, reference, PERIOD, par=par)
    return (
        after_step(integrate, FLOWN, state, command, steady_wind(), PERIOD)[0],
        command,
    )


def euler_step(state: State, par: Any, reference: Reference, draws: Any) -> Any:
    """The same with a fourth of the operations."""
    return flight_step(state, par, reference, draws, coupled_euler)


def flight_lanes(lanes: int) -> tuple[np.ndarray, np.ndarray]:
    """States and parameters of lanes that all fly differently."""
    carry = lanes_of(TILTED, 0.1, lanes, 3)
    carry[3:7] /= np.linalg.norm(carry[3:7], axis=0)
    return carry, lanes_of(CONTROLLER.par, 0.02, lanes, 4)


def tracking(state: State) -> Any:
    """Squared distance to a point (m^2) and the angle of a joint: a metric of a
    flight's end.
    """
    x, y, z = state.position.x - 0.3, state.position.y, state.position.z - 1.0
    return x * x + y * y + z * z + 0.1 * state.joints[0]


def flight_rows(steps: int) -> np.ndarray:
    """Leaves of the reference of every control instant."""
    return np.array([leaves(FLIGHT.at(PERIOD * k).dense()) for k in range(steps)])


def flight_row() -> Reference:
    """An example of a row."""
    return FLIGHT.at(0.0).dense()


def lanes_of(record: Any, spread: float, lanes: int, seed: int) -> np.ndarray:
    """(leaves, lanes): every leaf times 1 + spread * a uniform number of (-1, 1); lane
    0 is the record itself.
    """
    rng = np.random.default_rng([91, seed])
    values = np.array(leaves(record), dtype=float)
    factors = 1.0 + spread * rng.uniform(-1.0, 1.0, (values.size, lanes))
    factors[:, 0] = 1.0
    return values[:, None] * factors


def flown_in_python(
    loop: Any,
    carry: Any,
    parameters: Any,
    rows: Any,
    *,
    seed: int = 0,
    episode: int = 0,
    start: int = 0,
) -> tuple[np.ndarray, np.ndarray]:
    """One lane by Python floats, with numbers drawn by
    :mod:`skyarm.algebra.scalars.philox`: final carry and log.
    """
    step = loop.stepper()
    x: tuple[float, ...] = tuple(map(float, carry))
    p = tuple(map(float, parameters))
    log = []
    for k, row in enumerate(rows):
        draws = [
            float(u)
            for channel, count in loop.uniforms
            for u in philox.uniforms(seed, episode, channel, start + k, count)
        ]
        out = step((*x, *p, *map(float, row), *draws))
        x = out[: loop.carry]
        log.append(out[loop.carry :])
    return np.array(x), np.array(log)
