"""Words of the reports of lags, numbers, predictions, designs and excitation, as they
are printed.
"""

from __future__ import annotations

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest

import skyarm
from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.identify.design_report import design_facts, design_lines
from skyarm.identify.designed_flight import DesignedFlight, Sharpened
from skyarm.identify.flight_page import (
    excitation_facts,
    excitation_lines,
    excited_numbers,
    fault_line,
)
from skyarm.identify.held_out_errors import (
    HOLD,
    IDENTIFIED,
    PAST,
    START,
    HeldOut,
    HorizonErrors,
    OneStep,
)
from skyarm.identify.identified_numbers import (
    APART,
    GIVEN,
    NOT_SHOWN,
    Identified,
    IdentifiedNumber,
)
from skyarm.identify.identified_parts import IdentifiedSurroundings
from skyarm.identify.identified_report import (
    IdentifiedReport,
    _absent_line,
    _apart_lines,
    _few_names,
    correlated_pairs,
    prediction_csv,
    prediction_lines,
)
from skyarm.identify.information import ExpectedNumber
from skyarm.identify.lag_report import (
    lag_lines,
    lag_tables,
    nominal_model,
    stated_delays,
)
from skyarm.identify.log_checks import REFUSED, WARNED, LogFault
from skyarm.identify.loop_lags import Estimated, Lag, LoopLags

VEHICLE = skyarm.load_vehicle("hummingbird")


def times(value, half=0.001):
    """A time and its interval."""
    return Estimated.of(value, half)


def lag(name, **changed):
    """A lag of 12 ms and of 20 and 30 ms, whose delay is apart from them."""
    usual = {
        "together": times(0.036),
        "delay": times(0.012),
        "up": times(0.02),
        "down": times(0.03),
    }
    return Lag(
        name=name, **{**usual, "explained": 0.876, "factor": (1.5, 2.0), **changed}
    )


def lags(rotors, *joints, **left_out):
    return LoopLags(
        period=0.005, seconds=2.0, rotors=rotors, joints=joints, left_out=left_out
    )


NO_WORD = {"command": None, "measurement": None}
UNKNOWN = lag("joint2", reason="the commands hardly change", explained=0.0)


def test_the_table_of_lags_has_a_line_for_the_rotors_and_each_joint_in_milliseconds():
    joint = lag("joint1", down=times(0.02), factor=(math.nan, math.nan))
    lines = lag_lines("title", lags(lag("rotors"), joint, UNKNOWN), NO_WORD)
    assert lines[:5] == [
        "title",
        (
            "          delay and lag            delay               up             down"
            " over model explained"
        ),
        (
            "rotors 36.0 (35.0-37.0) 12.0 (11.0-13.0) 20.0 (19.0-21.0) 30.0 (29.0-31.0)"
            "  1.50 2.00       88%"
        ),
        (
            "joint1 36.0 (35.0-37.0) 12.0 (11.0-13.0) 20.0 (19.0-21.0) 20.0 (19.0-21.0)"
            "          -       88%"
        ),
        (
            "joint2        not known                                                   "
            "                   0%"
        ),
    ]
    alike = lag_lines("", lags(lag("rotors", factor=(1.5, 1.5))), NO_WORD)
    assert " 1.50       88%" in alike[2]


def test_the_notes_name_what_is_unknown_unasked_or_has_an_inseparable_delay():
    vague, prompt = (
        lag("joint1", apart=False),
        lag("joint3", apart=False, together=times(0.0005)),
    )
    found = lags(
        lag("rotors"), vague, UNKNOWN, prompt, gripper="its drive takes a setpoint, rad"
    )
    notes = lag_lines("", found, NO_WORD)[6:]
    assert notes == [
        (
            "ms, with the interval of 95 %; 'delay and lag': both together, as a small"
            " swing meets them."
        ),
        "joint2: not known: the commands hardly change",
        "gripper: not asked: its drive takes a setpoint, rad",
        (
            "joint1: delay and lag cannot be told apart in this flight; trust what they"
            " are together"
        ),
        (
            "The delay runs from a command to the logged rates: if the log holds them"
            " as they were received,"
        ),
        (
            "their age is in it, and what passes through the loop shows the sum of both"
            " only."
        ),
    ]
    stated = lag_lines("", lags(lag("rotors")), {"command": 0.012, "measurement": None})
    assert stated[3:] == [
        notes[0],
        (
            "The log holds the true state: delays are of commands alone. "
            "The scenario states: command 12 ms, measurement 0 ms."
        ),
    ]


@pytest.mark.parametrize(
    ("delays", "stated"),
    [
        ({"command": 0.01}, {"command": 0.01, "measurement": None}),
        ({"measurement": 0.02, "command": 0}, {"command": 0.0, "measurement": 0.02}),
        (None, {"command": None, "measurement": None}),
    ],
)
def test_delays_of_a_log_are_those_that_its_scenario_states(delays, stated):
    record = {"agent": {} if delays is None else {"delays": delays}}
    assert stated_delays(SimpleNamespace(info={"scenario_record": record})) == stated


def test_the_model_of_lags_is_the_vehicle_that_is_named_or_that_of_the_log_s_law():
    model = SimpleNamespace(vehicle=VEHICLE, gravity=9.7)
    agent = SimpleNamespace(model=model)
    log = SimpleNamespace(
        info={"scenario_record": "a"}, scenario=SimpleNamespace(agent=agent)
    )
    assert nominal_model(log, None, None) == (VEHICLE, 9.7)
    assert nominal_model(log, None, 9.8) == (VEHICLE, 9.8)
    assert nominal_model(log, "tilted_hexarotor", None) == (
        skyarm.load_vehicle("tilted_hexarotor"),
        9.81,
    )
    assert nominal_model(log, "tilted_hexarotor", 1.62)[1] == 1.62
    log.info["plant_gravity"] = 3.7
    assert nominal_model(log, "tilted_hexarotor", None)[1] == 3.7
    with pytest.raises(
        ValueError,
        match=r"^--vehicle: is missing; the log does not say which vehicle flew",
    ):
        nominal_model(SimpleNamespace(info={"scenario_record": ""}), None, None)


def test_tables_to_paste_hold_whole_steps_of_physics_and_lags_that_are_some():
    """A delay of 12.4 ms is 12 steps of 1 ms, and with an age of 8 ms four control
    periods of 5 ms.
    """
    rotors = lag("rotors", delay=times(0.0124))
    joint = lag("arm.1", up=times(0.02), down=times(0.02))
    lines = lag_tables(lags(rotors, joint, UNKNOWN), measured=0.008).splitlines()
    assert "command = 0.012  # 11.40 to 13.40 ms" in lines
    assert "# controller.delay = 0.02" in lines
    assert "# controller.delay_periods = 4" in lines
    assert "# time_constant_up = 0.0200  # 19.00 to 21.00 ms" in lines
    assert "# time_constant_down = 0.0300  # 29.00 to 31.00 ms" in lines
    assert lines[-3:] == [
        '[plant.drives."arm.1"]',
        'kind = "lagged_torque"',
        "time_constant = 0.0200  # 19.00 to 21.00 ms; beside a delay of 12.0 ms",
    ]


@pytest.mark.parametrize(
    ("joint", "drive"),
    [
        (lag("j", up=times(0.002, 0.0009)), True),
        (lag("j", up=times(0.002, 0.0011)), False),
        (
            lag(
                "j", apart=False, up=times(0.002, 0.002), together=times(0.0062, 0.001)
            ),
            True,
        ),
        (
            lag("j", apart=False, up=times(0.02, 0.001), together=times(0.0058, 0.001)),
            False,
        ),
        (dataclasses.replace(UNKNOWN, name="j"), False),
    ],
)
def test_a_joint_has_a_drive_with_a_lag_if_its_interval_tells_it_from_none(
    joint, drive
):
    """From a step of physics on where the delay is apart; else of both together from a
    control period on.
    """
    text = lag_tables(lags(lag("rotors", reason="too few"), joint))
    assert bool(text) is drive
    assert ("[plant.drives.j]" in text) is drive


def number(name, value=1.0, **changed):
    usual = {"unit": "m", "low": 0.9, "high": 1.1, "start": 2.0, "data_share": 0.9}
    return IdentifiedNumber(name=name, value=value, **{**usual, **changed})


def found_with(*numbers, **changed):
    usual = {
        "correlation": np.eye(len(numbers)),
        "vehicle": VEHICLE,
        "surroundings": IdentifiedSurroundings(delay=0.006),
        "explained": {"rate.x": 0.987, "rate.y": 0.5},
        "deviation": {},
        "settled": True,
        "seconds": 31.234,
    }
    return Identified(numbers=numbers, **{**usual, **changed})


def flight(name="a", **channels):
    """Flight of a gyro of 100 Hz and of commands that are held."""
    time = 0.01 * np.arange(300)
    draw = np.random.default_rng(1)
    every = {"gyro": 3, "rotor_speed_commands": 4, **channels}
    made = {
        key: Channel(time=time, values=draw.normal(size=(300, k)), source="")
        for key, k in every.items()
    }
    return FlightData(
        name=name,
        file=f"folder/{name}.csv",
        channels=made,
        notes=("file: is cut off.",),
    )


def report(found, *flights, **changed):
    usual = {"known": {}, "faults": (), "clocks": {}}
    return IdentifiedReport(
        found=found,
        start=VEHICLE,
        flights=flights or (flight(),),
        **{**usual, **changed},
    )


def test_the_table_of_numbers_has_values_intervals_and_starts_with_units_in_line():
    hidden = number("b", unit="kg m^2", reason=NOT_SHOWN)
    beside = number("base.com.x", unit="", reason=f"{APART}b")
    lines = report(
        found_with(number("longest.of.names", 0.123456), hidden, beside)
    ).lines()
    assert lines == [
        "hummingbird from a: 31.2 s",
        "                  value        95 % interval start unit",
        "longest.of.names 0.1235           0.9 to 1.1     2 m",
        "b                           not in this data     2 kg m^2",
        "base.com.x              not in this data (*)     2",
        "(*) known only together with b: base.com.x",
        GIVEN,
        "explained beyond noise: rate.x 99%, rate.y 50%",
        "a: file: is cut off.",
    ]
    short = report(
        found_with(number("a"), dataclasses.replace(hidden, name="b"))
    ).lines()
    assert [line.partition("     2 ")[2] for line in short[2:4]] == ["m", "kg m^2"]


def test_an_uncertain_result_is_said_behind_its_numbers():
    numbers = [
        number(name, widened=wide)
        for name, wide in (("p", 1.49), ("q", 1.51), ("r", 2.26))
    ]
    lines = report(found_with(*numbers, settled=False)).lines()
    assert (
        "the search did not settle: do not rely on these numbers; intervals hold its"
        " last moves alone" in lines
    )
    assert (
        "flights disagree; intervals are wider than their noise explains, times: q 1.5,"
        " r 2.3" in lines
    )
    sure = report(found_with(*numbers[:1])).lines()
    assert not any("settle" in each or "disagree" in each for each in sure)


def test_of_many_pairs_that_are_hard_to_separate_the_dozen_most_alike_are_named():
    names = [f"n{i}" for i in range(6)]
    draw = np.random.default_rng(3).uniform(0.91, 0.99, size=(6, 6))
    signs = np.where(np.arange(36).reshape(6, 6) % 2, -1.0, 1.0)
    rows = np.triu(draw * signs, 1)
    rows = rows + rows.T + np.eye(6)
    lines = report(found_with(*map(number, names), correlation=rows)).lines()
    told = [each for each in lines if each.startswith("hard to separate: ")]
    sizes = sorted(np.abs(rows[np.triu_indices(6, 1)]), reverse=True)
    assert [abs(float(each.rpartition(" ")[2])) for each in told] == pytest.approx(
        sizes[:12], abs=6e-4
    )
    assert "pairs with a correlation beyond 0.9 that are not shown: 3" in lines
    i, j = np.unravel_index(np.argmax(np.abs(np.triu(rows, 1))), (6, 6))
    assert told[0] == f"hard to separate: n{i} and n{j}, correlation {rows[i, j]:+.3f}"


def test_a_pair_is_hard_to_separate_beyond_nine_tenths_if_a_flight_shows_one_of_it():
    rows = np.eye(4)
    rows[0, 1] = rows[1, 0] = 0.899
    rows[0, 2] = rows[2, 0] = -0.901
    rows[1, 3] = rows[3, 1] = 0.95
    a, b, c, d = (
        number("a"),
        number("b", reason=NOT_SHOWN),
        number("c"),
        number("d", reason=NOT_SHOWN),
    )
    assert correlated_pairs(found_with(a, b, c, d, correlation=rows)) == [
        ("a", "c", -0.901)
    ]
    shown = dataclasses.replace(d, reason="")
    pairs = correlated_pairs(found_with(a, b, c, shown, correlation=rows))
    assert pairs == [("b", "d", 0.95), ("a", "c", -0.901)]


def test_a_heading_names_four_flights_and_how_many_more_there_are():
    assert _few_names(list("abcd")) == "a, b, c, d"
    assert _few_names(list("abcdef")) == "a, b, c, d and 2 more"


def test_numbers_that_show_beside_another_one_stand_in_a_line_of_that_one():
    numbers = [
        number(name, reason=f"{APART}{of}")
        for name, of in (("a", "m"), ("b", "n"), ("c", "m"))
    ]
    assert _apart_lines([*numbers, number("m"), number("n", reason=NOT_SHOWN)]) == [
        "(*) known only together with m: a, c",
        "(*) known only together with n: b",
    ]


def test_a_channel_that_is_absent_names_what_it_would_narrow_most_first():
    costs = {"a": 1.6, "b": 3.14159, "c": 1.49, "d": 2.0, "e": 2.5, "f": 1.7}
    assert (
        _absent_line("pose", costs)
        == "pose: not logged; intervals are wider than with one of motion capture,"
        " times about: b 3.1, e 2.5, d 2, f 1.7 and 1 more"
    )
    assert (
        _absent_line("joint_efforts", {"a": 1.6})
        == "joint_efforts: not logged; intervals are wider than with them, times about:"
        " a 1.6"
    )
    assert (
        _absent_line("position", {"a": 1.5})
        == "position: not logged; no interval would be narrower by more than 1.5 times"
        " with it"
    )


def test_the_vehicle_file_names_files_without_folders_and_given_numbers():
    known = {"voltage": 12.0, "base.com.y": 0.0}
    text = report(
        found_with(number("delay")), flight("a"), flight("b"), known=known
    ).vehicle_file()
    assert text.startswith(
        "# Identified by skyarm from 2 flights, 31.2 s:\n#   a.csv\n#   b.csv\n"
    )
    assert "given: base.com.y = 0\n" in text
    assert "voltage" not in text


def test_an_unused_voltage_is_reported_unless_that_of_the_rotors_is_known():
    said = (
        "voltage: is measured and not used: state that of the rotors' data, --known"
        " voltage=VALUE"
    )
    measured = flight("b", voltage=1)
    assert report(found_with(number("a")), flight(), measured).lines()[-1] == said
    assert (
        said
        not in report(
            found_with(number("a")), measured, known={"voltage": 12.0}
        ).lines()
    )
    assert said not in report(found_with(number("a"))).lines()


def test_measured_speeds_are_said_to_be_unused():
    said = (
        "rotor_speeds: are measured and not used: to use them, map them as"
        " rotor_speed_commands"
    )
    assert (
        report(found_with(number("a")), flight(), flight("b", rotor_speeds=4)).lines()[
            -1
        ]
        == said
    )
    assert said not in report(found_with(number("a"))).lines()


def test_the_document_has_no_value_that_flights_do_not_show_and_predictions_if_any():
    fault = LogFault(
        severity=WARNED,
        file="a.csv",
        channel="gyro",
        finding="is frozen",
        remedy="cut it",
    )
    numbers = number("a"), number("b", reason=NOT_SHOWN)
    found = found_with(*numbers, period=0.004, absent={"pose": {"a": 2.0}})
    document = report(found, faults=(fault,), known={"mass": 0.8}).document()
    shown, hidden = document["numbers"]
    assert (shown["value"], shown["low"], shown["high"], shown["start"]) == (
        1.0,
        0.9,
        1.1,
        2.0,
    )
    assert (hidden["value"], hidden["low"], hidden["high"], hidden["start"]) == (
        None,
        None,
        None,
        2.0,
    )
    assert (document["start"], document["seconds"], document["period"]) == (
        "hummingbird",
        31.234,
        0.004,
    )
    assert document["flights"] == [
        {"name": "a", "file": "folder/a.csv", "notes": ("file: is cut off.",)}
    ]
    assert document["faults"] == [
        {"severity": WARNED, "text": "a.csv: gyro: is frozen; cut it"}
    ]
    assert (document["known"], document["absent"]) == (
        {"mass": 0.8},
        {"pose": {"a": 2.0}},
    )
    assert "held_out" not in document
    predicted = dataclasses.replace(found, held_out=held_out())
    assert report(predicted).document()["held_out"] is predicted.held_out


def errors(size, horizons=(0.1, 0.2, 1.0), **changed):
    return [
        HorizonErrors(
            horizon=horizon,
            begins=7,
            **{
                "position": size * horizon,
                "velocity": size,
                "attitude": 0.1 * size,
                "rate": 0.5,
                **changed,
            },
        )
        for horizon in horizons
    ]


def held_out(**changed):
    step = OneStep(specific_force=0.1, angular_acceleration=0.2)
    usual = {
        "flights": ("a", "b"),
        "period": 0.01,
        "horizons": (0.1, 0.2, 1.0),
        "errors": {
            IDENTIFIED: errors(0.2),
            PAST: errors(0.1),
            START: errors(0.4),
            HOLD: errors(2.0),
        },
        "one_step": {
            IDENTIFIED: step,
            HOLD: OneStep(specific_force=0.3, angular_acceleration=0.4),
        },
        "has_poses": True,
        "notes": ("the position is the sum of the velocity",),
    }
    return HeldOut(**{**usual, **changed})


def test_predictions_stand_in_lines_of_the_table_s_horizons_and_predictors():
    lines = prediction_lines(held_out())
    assert lines == [
        "held out: a, b: errors of predictions",
        "horizon               position velocity attitude      rate predictions",
        "0.1 s   identified      0.02 m  0.2 m/s 0.02 rad 0.5 rad/s           7",
        "        with past       0.01 m  0.1 m/s 0.01 rad 0.5 rad/s           7",
        "        start vehicle   0.04 m  0.4 m/s 0.04 rad 0.5 rad/s           7",
        "        hold             0.2 m    2 m/s  0.2 rad 0.5 rad/s           7",
        "1 s     identified       0.2 m  0.2 m/s 0.02 rad 0.5 rad/s           7",
        "        with past        0.1 m  0.1 m/s 0.01 rad 0.5 rad/s           7",
        "        start vehicle    0.4 m  0.4 m/s 0.04 rad 0.5 rad/s           7",
        "        hold               2 m    2 m/s  0.2 rad 0.5 rad/s           7",
        "one step of 10 ms: specific force, m/s^2: identified 0.1, hold 0.3",
        "one step of 10 ms: angular acceleration, rad/s^2: identified 0.2, hold 0.4",
        (
            "Root mean squares; one step of 'hold': the spread of what is measured"
            " about its mean."
        ),
        (
            "'identified', 'start vehicle': from the state and the commands. 'with"
            " past': disturbances estimated until"
        ),
        (
            "the begin go on, and the model counts beside holding as much as is best in"
            " the flights of the fit."
        ),
        "the position is the sum of the velocity",
    ]


def test_of_flights_without_poses_and_pasts_their_errors_are_left_out():
    nothing = {"position": math.nan, "velocity": math.nan, "attitude": math.nan}
    every = {IDENTIFIED: errors(1.0, **nothing), HOLD: errors(1.0, **nothing)}
    lines = prediction_lines(held_out(errors=every, notes=()))
    assert lines[2].split() == [
        "0.1",
        "s",
        "identified",
        "-",
        "-",
        "-",
        "0.5",
        "rad/s",
        "7",
    ]
    assert lines[-1].startswith("Root mean squares")


def test_the_table_of_predictions_has_a_row_for_each_horizon_and_predictor():
    rows = prediction_csv(held_out()).splitlines()
    assert (
        rows[0]
        == "horizon_s,predictor,predictions,position_m,velocity_m_s,attitude_rad,"
        "rate_rad_s"
    )
    assert len(rows) == 1 + 3 * 4
    assert rows[1] == "0.1,identified,7,0.02,0.2,0.02,0.5"
    assert rows[-1] == "1,hold,7,2,2,0.2,0.5"


def expected(name, half_width=0.001, relative=0.0, data_share=0.9, unit="m"):
    return ExpectedNumber(
        name=name,
        unit=unit,
        start=1.0,
        half_width=half_width,
        relative=relative,
        data_share=data_share,
    )


def design(**changed):
    pairs = [
        Sharpened(
            designed=expected("base.com.x", 0.001),
            undesigned=expected("base.com.x", 0.0025),
        ),
        Sharpened(
            designed=expected("base.inertia.xx", 2e-5, 0.0031, unit="kg m^2"),
            undesigned=expected(
                "base.inertia.xx", 2e-4, 0.031, data_share=0.3, unit="kg m^2"
            ),
        ),
    ]
    usual = {
        "document": {},
        "numbers": pairs,
        "tilt": math.radians(21.4),
        "box": (1.0, 1.25, 0.5),
        "clearance": 0.123,
        "saturated": 0.0012,
    }
    return DesignedFlight(**{**usual, **changed})


def test_a_design_is_reported_with_both_intervals_and_what_the_flight_needs():
    lines = design_lines(design(), "hummingbird", 60.0)
    assert lines == [
        "excitation of hummingbird: 60 s",
        "                       95 % interval, designed         undesigned sharper by",
        "centre of mass along x               ± 0.001 m         ± 0.0025 m        2.5",
        "roll inertia                          ± 0.31 % not in this flight       10.0",
        (
            "In a simulated flight: base within 1.00 x 1.25 x 0.50 m, tilt at most 21"
            " deg, arm at least 0.12 m from rotors and base; 0.12% of the rotor"
            " commands at a limit."
        ),
        "Undesigned: the path on which tuned gains are validated, for as long.",
    ]
    bare = design_lines(design(clearance=math.inf), "hummingbird", 60.0)
    assert "arm" not in bare[-2]


def test_a_design_s_numbers_as_data_have_half_widths_in_the_unit():
    first, second = design_facts(design())
    assert first == {
        "name": "base.com.x",
        "unit": "m",
        "designed": 0.001,
        "undesigned": 0.0025,
        "sharper": 2.5,
    }
    assert (second["unit"], second["designed"], second["undesigned"]) == (
        "kg m^2",
        2e-5,
        2e-4,
    )


def test_excited_numbers_stand_with_their_accuracy_in_front_of_their_names(monkeypatch):
    numbers = [
        expected("base.com.x", 0.0012),
        expected("base.inertia.zz", relative=0.0123, data_share=0.5),
    ]
    numbers.append(expected("drift", data_share=0.49))
    assert excitation_lines(numbers) == [
        "centre of mass along x: excited (± 0.0012 m) base.com.x",
        "yaw inertia:            excited (± 1.2 %)    base.inertia.zz",
        "drift of the thrust:    not in this flight   drift",
    ]
    fault = LogFault(
        severity=WARNED,
        file="a.csv",
        channel="gyro",
        finding="is frozen",
        remedy="cut it",
    )
    assert fault_line(fault) == "warned: gyro: is frozen; cut it"
    facts = excitation_facts(VEHICLE, [fault], numbers)
    assert facts["start"] == "hummingbird"
    assert facts["faults"] == [
        {
            "severity": "warned",
            "file": "a.csv",
            "channel": "gyro",
            "finding": "is frozen",
            "remedy": "cut it",
            "words": "a.csv: gyro: is frozen; cut it",
        }
    ]
    told = [
        (each["name"], each["excited"], each["title"]) for each in facts["excitation"]
    ]
    assert told[0] == ("base.com.x", True, "centre of mass along x")
    assert told[2] == ("drift", False, "drift of the thrust")
    assert facts["excitation"][1]["verdict"] == "excited (± 1.2 %)"
    monkeypatch.setattr(
        "skyarm.identify.flight_page.expected_numbers",
        lambda flights, start: (flights, start),
    )
    assert excited_numbers("flight", VEHICLE, [fault]) == (["flight"], VEHICLE)
    assert (
        excited_numbers(
            "flight", VEHICLE, [fault, dataclasses.replace(fault, severity=REFUSED)]
        )
        == ()
    )
