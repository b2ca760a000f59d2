"""A law inside any layers learns a correction of its command in its own units; without
one nothing of it moves.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from skyarm.control.actuator_layer import plain_model, with_actuators
from skyarm.control.catalogue import make_controller
from skyarm.control.controller import innermost, with_correction, with_innermost
from skyarm.control.model import Model
from skyarm.control.safety import with_safety_layer
from skyarm.control.vectored_layer import pairs_model, with_tilting
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.actuators.drive import TorqueDrive
from skyarm.dynamics.actuators.servo import PositionServo
from skyarm.vehicle.thrust_table import ThrustTable
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.vehicle.vehicle_records import MountedDrive

ARM, TILTING = load_vehicle("hummingbird_arm2"), load_vehicle("voliro_like")
STIFFNESS = 9.0


@dataclasses.dataclass(frozen=True)
class Kept:
    """Memory of a law that keeps its command; a layer has cleared the flag of the last
    joint.
    """

    sent: Command
    applied: tuple[float, ...] = (1.0, 1.0, 0.0)


OWN = Command(rotor_speeds=(480.0, 470.0, 490.0, 475.0), efforts=(0.3, -0.1))
SENT = Command(rotor_speeds=(480.0, 476.0, 490.0, 475.0), efforts=(0.3, -0.12))
DRIVES = (TorqueDrive(), PositionServo(stiffness=STIFFNESS, damping=0.2, inertia=2e-3))
ON_SERVOS = dataclasses.replace(
    ARM,
    drives=tuple(
        MountedDrive(name=each.name, drive=drive)
        for each, drive in zip(ARM.joints, DRIVES, strict=True)
    ),
)


def layered(vehicle, kept):
    """Constants and memory of a controller with all layers, whose law keeps
    ``kept``.
    """
    model = Model(vehicle=vehicle)
    made = with_safety_layer(make_controller("decoupled_pd", plain_model(model)))
    if vehicle is not ARM:
        made = with_actuators(made, model, 0.005, servos=bool(vehicle.drives))
    return made.par, with_innermost(made.memory, kept)


@pytest.mark.parametrize(
    ("vehicle", "stiffness"),
    [(ARM, 1.0), (ON_SERVOS, STIFFNESS)],
    ids=["torques", "a servo"],
)
def test_a_law_inside_layers_learns_a_correction_of_its_command(vehicle, stiffness):
    par, memory = layered(vehicle, Kept(OWN))
    moved = with_correction(memory, par, OWN, SENT)
    found = innermost(moved)
    assert found.sent.rotor_speeds == pytest.approx(SENT.rotor_speeds)
    assert found.sent.efforts == pytest.approx((0.3, -0.1 - 0.02 * stiffness))
    assert found.applied == (0.0, 1.0, 0.0)
    assert with_correction(memory, par, OWN, OWN) == memory


def test_behind_a_thrust_table_the_correction_is_one_of_thrust():
    table = ThrustTable(
        speed=(200.0, 400.0, 600.0), thrust=(0.4, 1.5, 3.1), torque=(0.006, 0.02, 0.04)
    )
    own_thrust = {"table": table, "thrust_coefficient": table.thrust_coefficient}
    vehicle = dataclasses.replace(
        ARM,
        rotors=tuple(dataclasses.replace(each, **own_thrust) for each in ARM.rotors),
    )
    plain = np.sqrt(np.divide(table.thrust, table.thrust_coefficient))
    par, memory = layered(
        vehicle, Kept(Command(rotor_speeds=(plain[1],) * 4, efforts=(0.3, -0.1)))
    )
    own, sent = (
        Command(rotor_speeds=(each,) * 4, efforts=(0.3, -0.1))
        for each in table.speed[1:]
    )
    found = innermost(with_correction(memory, par, own, sent))
    assert found.sent.rotor_speeds == pytest.approx((plain[2],) * 4, rel=1e-6)


def test_on_tilting_rotors_the_correction_is_one_of_their_forces():
    model = Model(vehicle=TILTING)
    made = with_tilting(make_controller("centroidal", pairs_model(model)), model)
    number = len(TILTING.rotors)
    own, sent = (
        Command(rotor_speeds=(w,) * number, efforts=(0.0, 0.0)) for w in (500.0, 510.0)
    )
    kept = Kept(dataclasses.replace(own, rotor_speeds=(300.0,) * 2 * number))
    memory = with_innermost(made.memory, kept)
    found = innermost(with_correction(memory, made.par, own, sent)).sent
    fixed = iter(
        zip(
            pairs_model(model).vehicle.rotors,
            np.subtract(found.rotor_speeds, 300.0),
            strict=True,
        )
    )
    for rotor in TILTING.rotors:
        axes, moved = zip(*(next(fixed), next(fixed)), strict=True)
        pair = np.array([[float(c) for c in each.axis] for each in axes]).T
        # the modelled servos stand at zero, where a rotor pushes along its axis
        squares, *_ = np.linalg.lstsq(
            pair, np.array([float(c) for c in rotor.axis]), rcond=None
        )
        assert moved == pytest.approx(10.0 * np.sqrt(squares))
    assert with_correction(memory, made.par, own, own) == memory
