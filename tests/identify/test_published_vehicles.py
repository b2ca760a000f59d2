"""Vehicles of published flights: numbers that are known otherwise are found, from
starts that are off.
"""

from __future__ import annotations

import dataclasses
import lzma
import shutil
import warnings

import pytest

import skyarm
from skyarm.algebra import Sym3, Vec3
from skyarm.flight_data.flight_data import load_flight
from skyarm.identify.held_out_errors import HOLD, IDENTIFIED, PAST, START
from skyarm.identify.identify_windows import identify_by_windows
from support.vehicles import FLIGHTS, crazyflie, iris

pytest.importorskip("scipy", reason="needs the extra 'identify'")

pytestmark = pytest.mark.thorough


def unpacked(folder, name, into):
    """Packed flight of a folder, with the mapping of its columns."""
    shutil.copy(FLIGHTS / folder / "columns.toml", into)
    file = into / f"{name}.csv"
    file.write_bytes(
        lzma.decompress((FLIGHTS / folder / f"{name}.csv.xz").read_bytes())
    )
    return load_flight(file)


IRIS_MASS = 1.5 + 0.015 + 4 * 0.005 + 0.01
"""kg: base, inertial unit, rotors and receiver of PX4's iris.sdf."""

TRANSVERSE = 0.5 * (9.75e-7 + 0.000273104)
"""kg m^2, of a turning rotor, on the mean over a turn."""

IRIS_INERTIA = {
    "xx": 0.029125 + 0.005 * 2 * (0.22**2 + 0.20**2) + 4 * TRANSVERSE,
    "yy": 0.029125 + 0.005 * 4 * 0.13**2 + 4 * TRANSVERSE,
    "zz": 0.055225 + 0.005 * 2 * (0.22**2 + 0.20**2) + 0.005 * 4 * 0.13**2,
}
"""kg m^2: base and rotors, which are fixed but for the turning about their axis."""


def test_gazebo_s_iris_is_found_from_its_flight(tmp_path):
    """Thrust and drag within 1 %, inertia about y 1 %, x 11 %, z 6 %, from a start that
    is 15 % off.

    Commands are logged at 10 Hz. What they did in between puts the latter two beside
    their intervals.
    """
    true = iris()
    rotors = tuple(
        dataclasses.replace(
            each,
            position=Vec3(each.position.x, each.position.y, 0.023),
            thrust_coefficient=1.15 * 5.84e-6,
            moment_coefficient=0.85 * 0.06,
            drag_coefficient=1.75e-4,
            time_constant_up=0.02,
            time_constant_down=0.02,
        )
        for each in true.rotors
    )
    xx, yy, zz = (
        factor * float(getattr(true.base.inertia, axis)) for axis, factor in OFF.items()
    )
    base = dataclasses.replace(true.base, mass=IRIS_MASS, inertia=Sym3(xx, yy, zz))
    start = dataclasses.replace(true, base=base, rotors=rotors)
    flight = unpacked("gazebo_iris", "quadrotor_model", tmp_path)
    found = identify_by_windows([flight], start)
    assert found.settled
    assert found.period == pytest.approx(0.01)
    thrust = found["rotors.thrust_coefficient"]
    assert thrust.value == pytest.approx(5.84e-6, rel=0.01)
    assert thrust.low < 5.84e-6 < thrust.high
    for axis, truth in IRIS_INERTIA.items():
        number = found[f"base.inertia.{axis}"]
        assert number.is_known
        assert number.value == pytest.approx(
            truth, rel={"xx": 0.11, "yy": 0.01, "zz": 0.06}[axis]
        ), axis
        assert abs(number.value - truth) < 0.85 * (number.high - number.low), axis
    assert found["rotors.drag_coefficient"].value == pytest.approx(1.75e-4, rel=0.01)
    assert found["rotors.moment_coefficient"].value == pytest.approx(0.06, rel=0.01)
    # lags of a quarter of the logged commands' period
    for name in ("delay", "rotors.time_constant_up", "rotors.time_constant_down"):
        assert not found[name].is_known


OFF = {"xx": 0.85, "yy": 1.15, "zz": 0.95}
"""Of the true moments of inertia, where the search begins."""


def test_a_flight_of_nanobench_is_predicted_from_the_fit_of_another(tmp_path):
    """Fitted on the second of two flights of one kind, predicted on the first, from
    commands and from what was before.

    At half a second 0.127 m and 0.254 rad, and acceleration within a third of 2.17
    m/s^2, which the data set's authors reach; nowhere worse than holding.
    """
    seen, unseen = (
        unpacked("nanobench", name, tmp_path)
        for name in ("B8_star_fast_rep2", "B8_star_fast_rep1")
    )
    options = {
        "held_out": [unseen],
        "full_voltage": 4.2,
        "drag_height": True,
        "despite_faults": True,
    }
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        found = skyarm.identify_flights([seen], crazyflie(), **options)
    assert min(found.explained[row] for row in ("rate.x", "rate.y")) > 0.5
    errors = found.held_out.errors
    for model, held in zip(errors[PAST], errors[HOLD], strict=True):
        assert model.begins > 100
        for name in ("position", "velocity", "attitude", "rate"):
            # over a few samples both are within the noise
            assert getattr(model, name) < (
                1.1 if model.horizon < 0.05 else 1.0
            ) * getattr(held, name), (model, name)
    half = next(each for each in errors[PAST] if each.horizon == 0.5)
    assert half.position < 0.127
    assert half.attitude < 0.254
    assert found.held_out.one_step[IDENTIFIED].specific_force < 2.17 / 3.0
    # the start vehicle is worse by far
    first = next(each for each in errors[START] if each.horizon == 0.5)
    assert half.position < 0.67 * first.position
