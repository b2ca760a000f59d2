"""Laws with random states and references, and the laws that are tested one by one.

- Random states and references of the control tests, drawn with NumPy alone, and the
  records made of them.
- Which laws beyond the paper's own are tested one by one, and what their tests share.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.algebra import Quaternion, Vec3
from skyarm.control.catalogue import (
    ACCELERATION,
    HUMMINGBIRD,
    TORQUE,
    Controller,
    make_controller,
)
from skyarm.control.catalogue import LAWS as ALL_LAWS
from skyarm.control.model import Model
from skyarm.plant.interface import Truth
from skyarm.records.leaves import leaves, rebuild
from skyarm.reference import Reference, Trajectory
from skyarm.reference.signals import Constant
from skyarm.scenario.scenario_record import trimmed_state
from skyarm.sensing.measurement import Measurement
from skyarm.simulate import Scenario
from skyarm.simulate.batch import Batch

G = 9.81
ARM2 = skyarm.load_vehicle("hummingbird_arm2")
MODEL = Model(vehicle=ARM2, gravity=G)

LAWS = ("rotors_sim_position", "decoupled_pd", "hybrid_computed_torque")
JOINT_GAINS = {
    name: TORQUE if name == "decoupled_pd" else ACCELERATION for name in LAWS
}


def controller(name: str, model: Model = MODEL, **options: Any) -> Controller:
    """The law with the paper's gains."""
    joint_gains = JOINT_GAINS[name] if model.vehicle.n == 2 else None
    return make_controller(
        name, model, gains=HUMMINGBIRD, joint_gains=joint_gains, **options
    )


def step(flown: Controller, measurement: Measurement, reference: Reference) -> Any:
    """The command alone."""
    return flown.law((), measurement, reference, 0.005, par=flown.par)[1]


def unclipped(flown: Controller) -> Controller:
    """The law with every rotor doubled by one of opposite sign: what the clip at zero
    takes from one, the other has.
    """
    mixer = flown.par.mixer
    opposite = tuple(tuple(-entry for entry in row) for row in mixer.inverse)
    both = dataclasses.replace(
        mixer, inverse=mixer.inverse + opposite, highest=mixer.highest * 2
    )
    return dataclasses.replace(flown, par=dataclasses.replace(flown.par, mixer=both))


def raw_squares(command: Any) -> Any:
    """Squared speeds before the clip, (rad/s)^2, of a command of an :func:`unclipped`
    law.
    """
    both = squares(command)
    half = len(both) // 2
    return both[:half] - both[half:]


def unlimited(vehicle: Any = ARM2) -> Any:
    """The vehicle with joints whose effort has no limit, so that a limit hides no
    difference.
    """
    return vehicle.with_joints(effort_limit=np.inf)


@dataclass(frozen=True)
class Case:
    """One measurement and one reference as arrays (``euler`` is roll, pitch, yaw)."""

    p: Any
    euler: Any
    v: Any
    w: Any
    q: Any
    qd: Any
    p_d: Any
    v_d: Any
    a_d: Any
    yaw: float
    yaw_rate: float
    q_d: Any
    qd_d: Any
    qdd_d: Any

    @property
    def R(self) -> Any:
        """R_WB, by SciPy."""
        return Rotation.from_euler("ZYX", self.euler[::-1]).as_matrix()

    @property
    def quaternion(self) -> Any:
        """The same attitude as w, x, y, z, by SciPy."""
        x, y, z, w = Rotation.from_euler("ZYX", self.euler[::-1]).as_quat()
        return np.array([w, x, y, z])

    def measurement(self) -> Measurement:
        return Measurement(
            time=0.0,
            position=vec(self.p),
            quaternion=Quaternion(*self.quaternion.tolist()),
            velocity=vec(self.v),
            rate=vec(self.w),
            specific_force=Vec3(0.0, 0.0, G),
            joints=tuple(self.q.tolist()),
            joint_rates=tuple(self.qd.tolist()),
            rotor_speeds=(480.0,) * 4,
        )

    def reference(self) -> Reference:
        return Reference(
            position=vec(self.p_d),
            velocity=vec(self.v_d),
            acceleration=vec(self.a_d),
            yaw=self.yaw,
            yaw_rate=self.yaw_rate,
            joints=tuple(self.q_d.tolist()),
            joint_rates=tuple(self.qd_d.tolist()),
            joint_accelerations=tuple(self.qdd_d.tolist()),
        ).dense()


def vec(values: Any) -> Vec3:
    return Vec3(*(float(value) for value in values))


def cases(
    count: int, seed: int, *, joints: int = 2, pitch: float = np.radians(80.0)
) -> list[Case]:
    """Attitudes with |pitch| below the given one and any roll and yaw, any joints,
    rates of a few rad/s.
    """
    rng = np.random.default_rng(seed)
    return [_draw(rng, joints, pitch) for _ in range(count)]


def _draw(rng: np.random.Generator, n: int, pitch: float) -> Case:
    angles = np.array(
        [
            rng.uniform(-np.pi, np.pi),
            rng.uniform(-pitch, pitch),
            rng.uniform(-np.pi, np.pi),
        ]
    )
    return Case(
        p=rng.normal(size=3),
        euler=angles,
        v=rng.normal(size=3),
        w=3.0 * rng.normal(size=3),
        q=rng.uniform(-np.pi, np.pi, size=n),
        qd=4.0 * rng.normal(size=n),
        p_d=rng.normal(size=3),
        v_d=rng.normal(size=3),
        a_d=2.0 * rng.normal(size=3),
        yaw=float(rng.uniform(-np.pi, np.pi)),
        yaw_rate=float(rng.normal()),
        q_d=rng.uniform(-np.pi, np.pi, size=n),
        qd_d=rng.normal(size=n),
        qdd_d=3.0 * rng.normal(size=n),
    )


def hovering(
    *,
    joints: Any = (0.0, 0.0),
    position: Any = (0.0, 0.0, 1.0),
    euler: Any = (0.0, 0.0, 0.0),
) -> Case:
    """At rest on its reference (a tilt apart)."""
    q, zero = np.array(joints, dtype=float), np.zeros(3)
    still = np.zeros(len(q))
    return Case(
        p=np.array(position),
        euler=np.array(euler, dtype=float),
        v=zero,
        w=zero,
        q=q,
        qd=still,
        p_d=np.array(position),
        v_d=zero,
        a_d=zero,
        yaw=0.0,
        yaw_rate=0.0,
        q_d=q,
        qd_d=still,
        qdd_d=still,
    )


def changed(case: Case, **values: Any) -> Case:
    return dataclasses.replace(
        case,
        **{
            k: np.asarray(v, dtype=float) if np.ndim(v) else v
            for k, v in values.items()
        },
    )


def squares(command: Any) -> Any:
    """Squared rotor speeds, (rad/s)^2."""
    return np.array([np.square(speed) for speed in command.rotor_speeds])


def pushes(vehicle: Any, command: Any) -> tuple[Any, float]:
    """Body torque (N m) and thrust (N) that the rotor speeds make, rotor by rotor: r x
    f and the drag torque.
    """
    torque, thrust = np.zeros(3), 0.0
    for rotor, speed in zip(vehicle.rotors, command.rotor_speeds, strict=True):
        force = (
            np.array(tuple(rotor.axis), dtype=float)
            * rotor.thrust_coefficient
            * speed**2
        )
        arm = np.array(tuple(rotor.position), dtype=float)
        torque += (
            np.cross(arm, force) - rotor.direction * rotor.moment_coefficient * force
        )
        thrust += force[2]
    return torque, thrust


def stacked(records: list[Any]) -> Any:
    """Records of floats as one record of arrays."""
    columns = np.array([leaves(record) for record in records]).T
    return rebuild(records[0], iter(list(columns)))


RIVALS = (
    "bulut2019",
    "guo2023",
    "li2024",
    "kim2013",
    "l1_adaptive lateral",
    "indi",
)

STEPS = tuple(f"ct_ladder {steps}" for steps in range(1, 7))

TOP = "ct_ladder"
"""The law with every step: what covers it covers those with fewer."""

PAPER = ("rotors_sim_position", "decoupled_pd", "hybrid_computed_torque")


def covering(names: Any = ALL_LAWS) -> list[str]:
    """Laws, without any whose every line another one runs."""
    return sorted(names)


def make_law(name: str, model: Model, **options: Any) -> Controller:
    """A law by its name; "ct_ladder 3" has three steps, "l1_adaptive lateral" its
    lateral part.
    """
    law, _, word = name.partition(" ")
    more: dict[str, Any] = (
        {"lateral": True} if word == "lateral" else {"steps": int(word)} if word else {}
    )
    return make_controller(law, model, **more, **options)


def hover(joints: tuple[float, ...], height: float = 2.0) -> Trajectory:
    """Standing still with the arm at some angles."""
    return Trajectory(z=Constant(height), joints=tuple(Constant(q) for q in joints))


def hovering_scenario(
    law: str, vehicle: str, *, seconds: float, offset: float = 0.0, **options: Any
) -> Scenario:
    """Belief equal to truth, arm out to one side, begun ``offset`` metres beside the
    reference.
    """
    flown = skyarm.load_vehicle(vehicle)
    joints = tuple(0.3 / (i + 1) for i in range(flown.n))
    world = Truth(vehicle=flown, gravity=9.81)
    start = trimmed_state(world, Vec3(offset, 0.0, 2.0), 0.0, joints)
    return Scenario(
        name="hover",
        duration=seconds,
        plant=world,
        controller=make_law(law, Model(vehicle=flown, gravity=9.81), **options),
        reference=hover(joints),
        initial=start if offset else None,
    )


def flown_to_the_end(scenario: Scenario) -> Any:
    """State after a flight in machine code."""
    outcome = Batch(scenario).fly({})
    assert outcome.status[0] == "completed"
    return outcome.state


def replaced(controller: Controller, **fields: Any) -> Controller:
    """The controller with other constants."""
    return dataclasses.replace(
        controller, par=dataclasses.replace(controller.par, **fields)
    )


def scalars(values: Any) -> Any:
    """A tuple or Vec3 of scalars as an array."""
    return np.array([float(value) for value in values])
