"""Thrust tables: the curve is SciPy's, its inverse is exact, laws know them exactly,
wrong ones are refused.
"""

from __future__ import annotations

import dataclasses
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from skyarm.algebra import ZERO3, Vec3
from skyarm.algebra.monotone_curve import curve, inverse_curve
from skyarm.compile.llvm.lane_stepper import Quick
from skyarm.control.actuator_layer import plain_model, with_actuators
from skyarm.control.catalogue import make_controller
from skyarm.dynamics.actuators import Command, make_mixer
from skyarm.dynamics.actuators.hover import highest_thrust, hover_trim
from skyarm.dynamics.actuators.rotor import push, rotor_force, speed_of_push
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_file import scenario_from
from skyarm.sensing.measurement import blank_measurement
from skyarm.simulate import run
from skyarm.simulate.loop import run_in_python
from skyarm.vehicle.check import VehicleError
from skyarm.vehicle.thrust_table import ThrustTable
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.vehicle.vehicle_records import Rotor, Vehicle

DATA = Path(__file__).parents[1] / "data"

SPEED = (210.0, 330.0, 420.0, 530.0, 610.0, 705.0, 810.0, 930.0)
THRUST = (0.33, 0.85, 1.33, 2.05, 2.74, 3.52, 4.51, 5.72)
TORQUE = (0.006, 0.0145, 0.0231, 0.0365, 0.0482, 0.0641, 0.0852, 0.1122)
TABLE = ThrustTable(speed=SPEED, thrust=THRUST, torque=TORQUE)
ROTOR = Rotor(
    name="r",
    position=Vec3(0.2, 0.0, 0.0),
    direction=1,
    thrust_coefficient=TABLE.thrust_coefficient,
    moment_coefficient=TABLE.moment_coefficient,
    table=TABLE,
)

COLUMNS = {
    "speed": list(SPEED),
    "thrust": [2.0 * each for each in THRUST],
    "torque": [2.0 * each for each in TORQUE],
}


def tabled(tmp_path: Path, columns: dict[str, Any] = COLUMNS, head: str = "") -> Path:
    """The servo arm with rotors of a table, as a file."""
    from support.cases import toml_text

    document = tomllib.loads((DATA / "servo_arm.toml").read_text())
    defaults = document["rotor_defaults"]
    for name in ("thrust_coefficient", "moment_coefficient", "max_speed"):
        del defaults[name]
    defaults["thrust_table"] = columns
    (tmp_path / "v.toml").write_text(toml_text(document))
    return tmp_path / "v.toml"


def test_the_curve_is_scipys_over_the_squared_speed():
    theirs = PchipInterpolator([0.0, *np.square(SPEED)], [0.0, *THRUST])
    torque = PchipInterpolator([0.0, *np.square(SPEED)], [0.0, *TORQUE])
    for speed in (0.0, 50.0, 209.0, 210.0, 300.0, 612.3, 929.9, 930.0):
        force = rotor_force(ROTOR, speed, ZERO3)
        assert force.force.z == pytest.approx(theirs(speed**2), rel=1e-12, abs=1e-15)
        assert force.torque.z == pytest.approx(-torque(speed**2), rel=1e-12, abs=1e-15)
        assert force.torque.y == pytest.approx(
            -0.2 * theirs(speed**2), rel=1e-12, abs=1e-15
        )


@pytest.mark.parametrize("seed", range(20))
def test_any_rising_points_give_scipys_curve_and_its_inverse_gives_them_back(seed):
    random = np.random.default_rng(seed)
    count = int(random.integers(2, 9))
    xs, ys = (
        np.cumsum(random.exponential(size=count) + 0.05).tolist() for _ in range(2)
    )
    theirs = PchipInterpolator(xs, ys)
    for x in np.linspace(xs[0], xs[-1], 40).tolist():
        value = curve(x, xs, ys)
        assert value == pytest.approx(float(theirs(x)), rel=1e-9, abs=1e-12)
        assert curve(inverse_curve(value, xs, ys), xs, ys) == pytest.approx(
            value, rel=1e-9, abs=1e-9
        )
    assert curve(xs[0] - 1.0, xs, ys) == ys[0]
    if float(theirs.derivative()(xs[-1])) > 1e-3:
        beyond = curve(xs[-1] + 0.3, xs, ys)
        assert beyond == pytest.approx(
            ys[-1] + 0.3 * float(theirs.derivative()(xs[-1])), rel=1e-9
        )
        assert inverse_curve(beyond, xs, ys) == pytest.approx(xs[-1] + 0.3, rel=1e-9)


def test_a_program_evaluates_the_same_curve():
    program = Quick(
        lambda w: (push(ROTOR, w[0]), speed_of_push(ROTOR, w[0] * w[0])), (0.0,)
    )
    for speed in (0.0, 100.0, 431.0, 930.0, 990.0):
        program.inputs[0] = speed
        program.step()
        assert program.outputs.tolist() == pytest.approx(
            [push(ROTOR, speed), speed_of_push(ROTOR, speed**2)]
        )
    for value in np.linspace(0.0, push(ROTOR, 930.0), 25).tolist():
        assert push(ROTOR, speed_of_push(ROTOR, value)) == pytest.approx(
            value, rel=1e-12, abs=1e-9
        )


def test_a_parabolas_table_is_the_parabola():
    speeds = (100.0, 300.0, 500.0, 800.0)
    table = ThrustTable(speed=speeds, thrust=tuple(2e-5 * w * w for w in speeds))
    assert table.thrust_coefficient == pytest.approx(2e-5)
    for speed in (40.0, 250.0, 777.0):
        assert table.push(speed) == pytest.approx(speed**2, rel=1e-12)
        assert table.twist(speed) == table.push(speed), "without a column of torque"


def test_a_vehicle_with_tables_hovers_where_it_should(tmp_path):
    """Hover trim of the truth and a law that knows the table: it stays; one that knows
    the parabola alone sags.
    """
    vehicle = load_vehicle(tabled(tmp_path))
    assert all(rotor.max_speed == 930.0 for rotor in vehicle.rotors)
    assert highest_thrust(vehicle) == pytest.approx(6 * 2 * 5.72)
    trim = hover_trim(vehicle, (0.0, 0.0), 9.81)
    total = sum(
        rotor_force(r, w, ZERO3).force.z
        for r, w in zip(vehicle.rotors, trim.speeds, strict=True)
    )
    assert total == pytest.approx(vehicle.mass * 9.81, rel=1e-9)
    assert trim.speeds[0] ** 2 != pytest.approx(trim.squared[0], rel=1e-3)
    scenario = hovering(tmp_path, vehicle)
    log = run(scenario)
    assert np.abs(log.position - log.position[0]).max() < 1e-3
    np.testing.assert_array_equal(log.position, run_in_python(scenario).position)
    theirs = run(dataclasses.replace(scenario, kind="mujoco"))
    np.testing.assert_allclose(theirs.position, log.position, rtol=0.0, atol=1e-4)


def hovering(tmp_path: Path, vehicle: Vehicle) -> Any:
    document = tomllib.loads((DATA / "servo_flight.toml").read_text())
    document["plant"]["vehicle"] = "v.toml"
    document["controller"] = {"preset": "paper_pd"}
    document["reference"] = {"base": {"kind": "hover", "position": [0.0, 0.0, 2.0]}}
    return scenario_from(document, tmp_path, {"duration": 0.5})


def test_a_thrust_coefficient_that_varies_scales_the_table(tmp_path):
    scenario = hovering(tmp_path, load_vehicle(tabled(tmp_path)))
    at = "plant.vehicle.rotors.0.thrust_coefficient"
    held = scenario.plant.vehicle.rotors[0]
    weak = with_numbers(
        scenario, {at: 0.9 * held.thrust_coefficient}
    ).plant.vehicle.rotors[0]
    assert rotor_force(weak, 500.0, ZERO3).force.z == pytest.approx(
        0.9 * rotor_force(held, 500.0, ZERO3).force.z
    )


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            {"thrust": [*THRUST[:-1], 4.0]},
            r"thrust_table\.thrust\[7\] = 4\.0: must be above the one before it, 4\.51",
        ),
        (
            {"speed": [210.0, 200.0, *SPEED[2:]]},
            r"thrust_table\.speed\[1\] = 200\.0: must be above",
        ),
        (
            {"thrust": [0.1]},
            r"thrust_table\.thrust = \(0\.1,\): must be at least two numbers",
        ),
        (
            {"torque": [0.1, 0.2]},
            r"thrust_table\.torque = .*: must be 8 numbers, as many as speeds",
        ),
        (
            {"speed": [0.0, *SPEED[1:]]},
            r"thrust_table\.thrust\[0\] = 0\.33: must be 0 at rest",
        ),
        ({"speed": None}, r"rotor_defaults\.thrust_table\.speed: is missing"),
        (
            {"amps": [1.0]},
            r"amps.*unknown field; allowed: speed, thrust, torque, current",
        ),
        (
            {"throttle": [0.1]},
            r"throttle.*unknown field; allowed: speed, thrust, torque, current",
        ),
        (
            {"thrust": [float("nan"), *THRUST[1:]]},
            r"thrust\[0\] = nan: must be a finite number",
        ),
    ],
)
def test_a_table_that_is_none_is_refused_in_one_line(tmp_path, change, words):
    columns = {
        "speed": list(SPEED),
        "thrust": list(THRUST),
        "torque": list(TORQUE),
    } | change
    with pytest.raises(VehicleError, match=words) as found:
        load_vehicle(
            tabled(
                tmp_path,
                {
                    name: column
                    for name, column in columns.items()
                    if column is not None
                },
            )
        )
    assert "\n" not in str(found.value)
    assert str(found.value).startswith(str(tmp_path))


def test_a_law_thinks_in_k_f_and_its_rotors_turn_as_the_table_has_it(tmp_path):
    """What it is told and what it asks for are speeds at which k_f W^2 is the table's
    thrust.
    """
    scenario = hovering(tmp_path, load_vehicle(tabled(tmp_path)))
    model = scenario.controller.par.model
    plain = plain_model(model)
    k = plain.vehicle.rotors[0].thrust_coefficient
    assert k * plain.vehicle.rotors[0].max_speed ** 2 == pytest.approx(2.0 * 5.72)
    seen = []

    def law(memory: Any, measurement: Any, reference: Any, dt: Any, *, par: Any) -> Any:
        seen.append((measurement.rotor_speeds, par.model))
        return memory, Command(rotor_speeds=(500.0,) * 6, efforts=(0.0, 0.0))

    inner = dataclasses.replace(
        make_controller("decoupled_pd", plain), law=law, memory=()
    )
    made = with_actuators(inner, model, 0.005)
    reading = dataclasses.replace(blank_measurement(2, 6), rotor_speeds=(705.0,) * 6)
    _, command = made.law(
        made.memory, reading, scenario.reference.at(0.0), 0.005, par=made.par
    )
    told, believed = seen[-1]
    assert believed.vehicle.rotors[0].table is None
    assert k * told[0] ** 2 == pytest.approx(2.0 * 3.52), "the row of 705 rad/s"
    turned = rotor_force(
        model.vehicle.rotors[0], command.rotor_speeds[0], ZERO3
    ).force.z
    assert turned == pytest.approx(k * 500.0**2)
    assert command.rotor_speeds[0] != pytest.approx(500.0, rel=1e-3)


def test_the_mixers_limit_is_the_tables_highest_thrust(tmp_path):
    vehicle = load_vehicle(tabled(tmp_path))
    rotor = vehicle.rotors[0]
    assert rotor.thrust_coefficient * make_mixer(vehicle).highest[0] == pytest.approx(
        2.0 * 5.72
    )
