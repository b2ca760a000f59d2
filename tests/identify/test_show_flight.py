"""``skyarm show FLIGHT``: channels, clock and notes of a log, and what it shows of a
vehicle.
"""

from __future__ import annotations

import json
import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.identify import flight_page, identify_windows
from skyarm.identify.window_fit import fit_windows
from skyarm.vehicle.vehicle_text import vehicle_text
from support.commands import refused, skyarm
from support.vehicles import CRAZYFLIE_LOG, IRIS_LOG, TREFOIL_LOG, crazyflie, iris

pytest.importorskip("scipy", reason="needs the extra 'identify'")


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("crazyflie.toml").write_text(vehicle_text(crazyflie()))


def test_a_log_without_suffix_is_a_flight():
    shown = skyarm("show", str(CRAZYFLIE_LOG), columns=200)
    assert shown.code == 0
    text = shown.out
    assert "log15_from_20_to_23_s: crazyflie, 2.999 s" in text
    assert re.search(
        r"^rotor_commands \(4\) +motor\.m1, .* 1008 +0 to 2\.999 +none$",
        text,
        re.MULTILINE,
    )
    assert "clock: unknown: " in text


def test_a_page_of_a_table_as_json():
    page = json.loads(skyarm("show", str(TREFOIL_LOG), "--json").out)
    channels = {each["quantity"]: each for each in page["channels"]}
    assert (page["format"], page["duration_s"]) == (
        "csv",
        pytest.approx(2.99, rel=1e-3),
    )
    assert channels["gyro"]["rate_hz"] == pytest.approx(100.0, rel=1e-3)
    assert channels["gyro"]["unit"] == "rad/s"
    assert channels["voltage"]["source"] == "pwr_pm_vbat"
    # its motion repeats itself
    assert page["clock"].startswith("unknown: clocks: offsets of ")
    assert "excitation" not in page


@pytest.fixture
def unsearched(monkeypatch):
    """Without the search for faults, which is tested elsewhere."""
    monkeypatch.setattr(flight_page, "find_faults", lambda *_: ())


@pytest.mark.usefixtures("unsearched")
def test_a_vehicle_s_numbers_are_excited_or_not_in_this_flight(monkeypatch):
    # a few turns tell which are: accuracies are tested elsewhere
    monkeypatch.setattr(identify_windows, "fit_windows", partial(fit_windows, turns=4))
    words = ("show", str(TREFOIL_LOG), "--vehicle", "crazyflie.toml")
    text = skyarm(*words, columns=200).out
    assert re.search(
        r"^thrust coefficient: +excited \(± \d\.\d %\) +rotors\.thrust_coefficient$",
        text,
        re.MULTILINE,
    )
    assert re.search(
        r"^roll inertia: +not in this flight +base\.inertia\.xx$", text, re.MULTILINE
    )
    assert re.search(
        r"^body drag along x: +not in this flight +drag\.area\.x$", text, re.MULTILINE
    )


def test_of_a_flight_with_a_fault_no_excitation_is_shown():
    page = json.loads(
        skyarm("show", str(TREFOIL_LOG), "--vehicle", "crazyflie_arm1", "--json").out
    )
    assert page["faults"][0]["severity"] == "refused"
    assert page["faults"][0]["words"].endswith(
        "joint_positions: are not in this flight; log them: they move its mass"
    )
    assert page["excitation"] == []


@pytest.mark.usefixtures("unsearched")
def test_of_a_log_that_is_too_short_the_channels_are_shown_and_what_is_needed():
    Path("iris.toml").write_text(vehicle_text(iris()))
    shown = skyarm("show", str(IRIS_LOG), "--vehicle", "iris.toml", columns=200)
    refused(
        shown,
        "quadrotor_model_from_20_to_23_s",
        "1 of the 4 parts of 1 s that are needed lie in the air",
    )
    assert re.search(
        r"^gyro +rad/s +ang_vel_x, ang_vel_y, ang_vel_z +100 +0 to 2\.99 +none$",
        shown.out,
        re.MULTILINE,
    )


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ("show", str(TREFOIL_LOG), "--gravity", "9.8"),
            "--gravity: must be left out of a flight",
        ),
        (
            ("show", "crazyflie.toml", "--vehicle", "hummingbird"),
            "--vehicle: must be left out of a vehicle",
        ),
        (
            ("show", "--columns", "c.toml"),
            "--columns: must be left out without a vehicle or flight",
        ),
        (("show", "none.csv"), "none.csv"),
    ],
)
def test_options_that_have_no_effect_are_one_line(words, message):
    refused(skyarm(*words), message)


def test_a_page_says_what_is_missing_for_what_and_what_to_do_next(tmp_path):
    shown = skyarm("show", str(CRAZYFLIE_LOG), columns=200).out
    assert (
        "missing: quaternion: without it no drag, no check of the clocks, and wider"
        " intervals" in shown
    )
    assert shown.rstrip().endswith(
        f"next: skyarm show {CRAZYFLIE_LOG} --vehicle VEHICLE"
    )
    whole = skyarm("show", str(TREFOIL_LOG), columns=200).out
    assert "missing: " not in whole
    Path("columns.toml").write_text(
        '[time]\ncolumn = "t"\n[gyro]\ncolumns = ["p", "q", "r"]\n'
    )
    Path("a b.csv").write_text(
        "t,p,q,r\n"
        + "".join(f"{0.01 * k + 6.0 * (k > 50)},1,2,{k}\n" for k in range(100))
    )
    poor = skyarm("show", "a b.csv", columns=200).out
    for name in ("accelerometer", "rotor_commands"):
        assert f"missing: {name}: nothing can be identified without it" in poor
    assert "missing: gyro" not in poor
    assert "flights: 2, with pauses of more than 5 s between them; all are read" in poor
    assert re.search(
        r"^flight #2: 6\.51 to 6\.99 s: skyarm show 'a b\.csv#2'$", poor, re.MULTILINE
    )
    second = json.loads(skyarm("show", "a b.csv#2", "--json").out)
    assert (second["flight"], second["flights"], second["choices"]) == ("a b#2", 1, {})
    assert second["channels"][0]["begin_s"] == pytest.approx(6.51)
    refused(
        skyarm("show", "a b.csv#3"),
        "flight = 'a b.csv#3': flight #3: must be 1 to 2, the flights of this file",
    )
    assert "next: " not in poor


@pytest.mark.usefixtures("unsearched")
def test_behind_the_excitation_stands_the_search_to_run(monkeypatch):
    monkeypatch.setattr(identify_windows, "fit_windows", partial(fit_windows, turns=1))
    shown = skyarm(
        "show", str(TREFOIL_LOG), "--vehicle", "crazyflie.toml", columns=200
    ).out
    assert (
        f"next: skyarm identify flights {TREFOIL_LOG} --vehicle crazyflie.toml --known"
        " mass=KG" in shown
    )


def test_the_next_command_has_the_mapping_of_the_columns():
    Path("my map.toml").write_text(
        '[time]\ncolumn = "t"\n'
        '[gyro]\ncolumns = ["p", "q", "r"]\n'
        '[accelerometer]\ncolumns = ["p", "q", "r"]\n'
        '[rotor_commands]\ncolumns = ["p"]\n'
    )
    rows = "".join(f"{0.01 * k},0.1,0.2,0.3\n" for k in range(100))
    Path("mapped.csv").write_text("t,p,q,r\n" + rows)
    shown = skyarm("show", "mapped.csv", "--columns", "my map.toml", columns=200).out
    assert shown.rstrip().endswith(
        "next: skyarm show mapped.csv --columns 'my map.toml' --vehicle VEHICLE"
    )


def test_the_channels_are_drawn_into_a_file():
    shown = skyarm("show", str(TREFOIL_LOG), "-o", "channels.png")
    assert (shown.code, shown.out.strip()) == (0, "drawing: channels.png")
    assert Path("channels.png").read_bytes().startswith(b"\x89PNG")
    refused(
        skyarm("show", str(TREFOIL_LOG), "-o", "channels.csv"),
        "--out",
        "suffix 'csv'",
        "png",
    )
    refused(
        skyarm("show", str(TREFOIL_LOG), "-o", "a.png", "--vehicle", "crazyflie.toml"),
        "--vehicle",
        "beside --out",
    )


def test_three_rotors_are_no_axes_and_joints_have_their_names():
    channels = {
        name: Channel(
            time=np.arange(2.0), values=np.zeros((2, count)), source="", names=own
        )
        for name, count, own in (
            ("gyro", 3, ()),
            ("quaternion", 4, ()),
            ("rotor_commands", 3, ()),
            ("joint_positions", 2, ("shoulder", "elbow")),
        )
    }
    flight = FlightData(name="a", file="a.csv", channels=channels)
    found = [flight_page._columns(name, flight) for name in channels]
    assert found == [
        ("x", "y", "z"),
        ("w", "x", "y", "z"),
        ("1", "2", "3"),
        ("shoulder", "elbow"),
    ]
