"""No law knows where north is: the same flight, turned about the vertical, gets the
same command.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from law_parts import with_parts
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.algebra import Quaternion, Vec3
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.model import Model
from skyarm.reference import Reference
from skyarm.sensing.measurement import Measurement
from support.laws import STEPS, make_law

MODEL = Model(vehicle=skyarm.load_vehicle("hummingbird_arm2_rotors"), gravity=9.8)
DT = 0.005
LAWS = {
    "centroidal": lambda: make_centroidal(MODEL, delay=DT),
    "centroidal_tip": lambda: make_centroidal(MODEL, mode="tip", delay=DT),
    "unmoved": lambda: make_centroidal(MODEL, mode="tip", preview=0.0, lag=(0.0, 0.0)),
    **{
        name: lambda name=name: make_law(name, MODEL)
        for name in ("hybrid_computed_torque", *STEPS)
    },
}


def turned(yaw, values):
    return Vec3(*Rotation.from_rotvec([0.0, 0.0, yaw]).apply(values).tolist())


def seen(yaw, rng):
    """Two measurements and references a period apart, of a tilted vehicle in any
    motion, turned by ``yaw``.
    """
    found = []
    for _ in range(2):
        attitude = Rotation.from_rotvec([0.0, 0.0, yaw]) * Rotation.from_euler(
            "ZYX", [0.9, -0.25, 0.3]
        )
        x, y, z, w = attitude.as_quat().tolist()
        q, qd, specific = (
            0.3 * rng.normal(size=2),
            rng.normal(size=2),
            rng.normal(size=3),
        )
        measurement = Measurement(
            time=0.0,
            position=turned(yaw, 0.05 * rng.normal(size=3)),
            quaternion=Quaternion(w, x, y, z),
            velocity=turned(yaw, 0.3 * rng.normal(size=3)),
            rate=Vec3(*(0.5 * rng.normal(size=3)).tolist()),
            specific_force=Vec3(*specific.tolist()),
            joints=tuple(q.tolist()),
            joint_rates=tuple(qd.tolist()),
            rotor_speeds=tuple((480.0 + 20.0 * rng.normal(size=4)).tolist()),
        )
        base = [
            turned(yaw, scale * rng.normal(size=3))
            for scale in (0.05, 0.3, 0.5, 1.0, 2.0)
        ]
        heading = rng.normal(size=3) * [0.1, 0.3, 0.5]
        arm = rng.normal(size=(5, 2)) * np.array([0.3, 0.5, 1.0, 1.0, 1.0])[:, None]
        reference = Reference(
            **dict(
                zip(
                    ("position", "velocity", "acceleration", "jerk", "snap"),
                    base,
                    strict=True,
                )
            ),
            yaw=0.9 + yaw + float(heading[0]),
            yaw_rate=float(heading[1]),
            yaw_acceleration=float(heading[2]),
            **{
                name: tuple(row.tolist())
                for name, row in zip(
                    (
                        "joints",
                        "joint_rates",
                        "joint_accelerations",
                        "joint_jerks",
                        "joint_snaps",
                    ),
                    arm,
                    strict=True,
                )
            },
        )
        found.append((measurement, reference))
    return found


def commanded(name, yaw, seed):
    controller = LAWS[name]()
    memory, rng = controller.memory, np.random.default_rng(seed)
    push = turned(yaw, [0.6, -0.4, 0.3])
    if hasattr(getattr(memory, "observed", None), "force"):
        memory = dataclasses.replace(
            memory, observed=dataclasses.replace(memory.observed, force=push)
        )
    if hasattr(memory, "slow_force"):
        adapted = dataclasses.replace(memory.parts.adaptation, tip_mass=0.03)
        memory = with_parts(
            dataclasses.replace(memory, slow_force=push), adaptation=adapted
        )
    commands = []
    for measurement, reference in seen(yaw, rng):
        memory, command = controller.law(
            memory, measurement, reference, DT, par=controller.par
        )
        commands.append([*command.rotor_speeds, *command.efforts])
    return np.array(commands)


@pytest.mark.parametrize("name", LAWS)
def test_a_turned_world_changes_no_command(name):
    """A rotation the wrong way round, a component for another, a world vector taken for
    one of the body do.
    """
    plain = commanded(name, 0.0, 4)
    # sums of some hundred rounded terms; rotor speeds are near 500
    np.testing.assert_allclose(commanded(name, -2.1, 4), plain, rtol=1e-8, atol=1e-10)
    assert np.ptp(plain[:, :4]) > 10.0
