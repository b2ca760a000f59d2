"""Steps of an identification: what is asked of whom, in which order, of flights and of
files; nothing is fitted.
"""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

import skyarm
from skyarm.flight_data.clocks import ClockOffset
from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.identify import identify_files as files_of
from skyarm.identify import identify_flights as flights_of
from skyarm.identify.identified_numbers import Identified
from skyarm.identify.identified_parts import (
    SCALED,
    IdentifiedSurroundings,
    vehicle_with,
)
from skyarm.identify.identify_files import FlightFiles, identify_files
from skyarm.identify.identify_flights import identify_aligned
from skyarm.identify.identify_windows import SearchOptions
from skyarm.identify.log_checks import REFUSED, WARNED, LogFault
from skyarm.identify.logged_commands import are_samples

START = skyarm.load_vehicle("hummingbird")
CLOCK = ClockOffset("gyro", "quaternion", 0.01, 1e-4, 0.0, 1e-6, 0.0, 0.0, 0.99)


def flight(name, seed=0, begin=0.0, **facts):
    """Flight of ten seconds."""
    time = begin + 0.01 * np.arange(1001)
    rates = np.random.default_rng(seed).normal(size=(time.size, 3))
    gyro = Channel(time=time, values=rates, source="gyro")
    return FlightData(
        name=name, file=f"{name}.csv", channels={"gyro": gyro}, facts=facts
    )


def fault(severity=WARNED, file="a.csv"):
    return LogFault(
        severity=severity, file=file, channel="gyro", finding="is odd", remedy="cut it"
    )


def found(counted):
    return Identified(
        numbers=(),
        correlation=np.eye(0),
        vehicle=START,
        surroundings=IdentifiedSurroundings(),
        explained={},
        deviation={},
        settled=True,
        seconds=3.0,
        counted=counted,
    )


@pytest.fixture
def asked(monkeypatch):
    """What the search for faults, the fit, the doubts and the prediction were asked,
    and what they answer.
    """
    asked = SimpleNamespace(
        checked=[], fitted=[], doubted=[], predicted=[], faults=(), doubts=()
    )

    def checked(flight, start):
        asked.checked.append((flight.name, flight.start, flight.end, start))
        return asked.faults

    def fitted(flights, start, options, progress):
        asked.fitted.append((flights, start, options, progress))
        return found((True,) * len(flights))

    def doubted(found, start, file, flights):
        asked.doubted.append((start, file, [each.name for each in flights]))
        return asked.doubts

    def predicted(found, start, held_out, options, *, seen):
        asked.predicted.append(
            ([each.name for each in held_out], options, [each.name for each in seen])
        )
        return "predictions"

    for name, each in (
        ("find_faults", checked),
        ("identify_by_windows", fitted),
        ("doubtful_numbers", doubted),
        ("predict_held_out", predicted),
    ):
        monkeypatch.setattr(flights_of, name, each)
    return asked


def test_options_of_the_function_are_those_of_the_search(asked):
    known = {"mass": 0.8, "delay": 0.004}
    found = skyarm.identify_flights(
        [flight("a")],
        START,
        curve=True,
        drag_height=True,
        full_voltage=12.6,
        sections=[(1.0, 2.0), (4.0, 6.0)],
        known=known,
        gravity=9.8,
    )
    ((flights, start, options, progress),) = asked.fitted
    assert [each.name for each in flights] == ["a"]
    assert dataclasses.asdict(options) == {
        "curve": True,
        "drag_height": True,
        "full_voltage": 12.6,
        "sections": [(1.0, 2.0), (4.0, 6.0)],
        "known": {"delay": 0.004},
        "gravity": 9.8,
    }
    assert float(start.mass) == pytest.approx(0.8)
    assert progress is None
    assert (found.held_out, asked.predicted) == (None, [])
    assert known == {"mass": 0.8, "delay": 0.004}
    skyarm.identify_flights([flight("a")], START)
    assert dataclasses.asdict(asked.fitted[1][2]) == dataclasses.asdict(SearchOptions())


def test_poses_are_on_the_gyro_s_clock_before_the_fit_and_the_prediction(
    asked, monkeypatch
):
    monkeypatch.setattr(
        flights_of,
        "align_poses",
        lambda each: (dataclasses.replace(each, name=each.name * 2), None),
    )
    result = skyarm.identify_flights([flight("a")], START, held_out=[flight("b")])
    assert [each.name for each in asked.fitted[0][0]] == ["aa"]
    assert asked.predicted == [(["bb"], asked.fitted[0][2], ["aa"])]
    assert result.held_out == "predictions"


@pytest.mark.parametrize("sampled", [False, True])
def test_held_out_flights_have_samples_of_commands_where_those_of_the_fit_had(
    asked, monkeypatch, sampled
):
    monkeypatch.setattr(
        flights_of,
        "identify_by_windows",
        lambda *_: dataclasses.replace(found((True,)), sampled=sampled),
    )
    seen = []
    monkeypatch.setattr(
        flights_of,
        "predict_held_out",
        lambda *given, **more: seen.append((given[2], more)),
    )
    skyarm.identify_flights([flight("a")], START, held_out=[flight("b")])
    ((held_out, more),) = seen
    assert [are_samples(each) for each in (*held_out, *more["seen"])] == [sampled] * 2


def test_faults_are_sought_in_sections_of_the_fit_and_in_whole_held_out_flights(asked):
    told, reported = [], []
    options = SearchOptions(sections=[(1.0, 2.0), (4.0, 6.0)])
    asked.faults, asked.doubts = (fault(),), (fault(file="doubt"),)
    identify_aligned(
        [flight("a"), flight("b")],
        START,
        options,
        reported.append,
        despite_faults=False,
        held_out=[flight("c")],
        progress=told.append,
    )
    assert asked.checked == [
        ("a", 1.0, 2.0, START),
        ("a", 4.0, 6.0, START),
        ("b", 1.0, 2.0, START),
        ("b", 4.0, 6.0, START),
        ("c", 0.0, 10.0, START),
    ]
    assert reported == [*[fault()] * 5, *asked.doubts]
    assert asked.doubted == [(START, "a.csv", ["a", "b"])]
    assert told == ["look for faults", "predict the held-out flights"]
    asked.checked.clear()
    identify_aligned(
        [flight("a")],
        START,
        SearchOptions(),
        reported.append,
        despite_faults=False,
        held_out=(),
        progress=None,
    )
    assert asked.checked == [("a", 0.0, 10.0, START)]


def test_a_flight_of_which_no_part_counts_is_warned_of(asked, monkeypatch):
    monkeypatch.setattr(
        flights_of, "identify_by_windows", lambda *_: found((True, False))
    )
    reported = []
    identify_aligned(
        [flight("a"), flight("b")],
        START,
        SearchOptions(),
        reported.append,
        despite_faults=False,
        held_out=(),
        progress=None,
    )
    (short,) = reported
    assert (
        short.words
        == "b.csv: time: no part counts: nowhere 0.25 s in the air without a gap; leave"
        " it out, or fly longer"
    )
    assert short.severity == WARNED


def test_a_refused_fault_ends_all_before_the_fit_unless_it_is_flown_despite(asked):
    asked.faults = (fault(), fault(REFUSED))
    with pytest.raises(ValueError, match=r"^a\.csv: gyro: is odd; cut it$"):
        skyarm.identify_flights([flight("a")], START)
    assert asked.fitted == []
    with pytest.warns(UserWarning, match=r"^a\.csv: gyro: is odd; cut it$") as warned:
        skyarm.identify_flights([flight("a")], START, despite_faults=True)
    assert len(warned) == 2
    assert warned[0].filename == __file__, "the caller's line is named"
    assert len(asked.fitted) == 1


@pytest.fixture
def files(monkeypatch):
    """Files of flights, by name."""
    files = {"a.csv": flight("a", 1), "b.csv": flight("b", 2), "c.csv": flight("c", 3)}
    monkeypatch.setattr(files_of, "load_flight", lambda file, columns=None: files[file])
    return files


def of_files(*names, held_out=(), **changed):
    """Report of files of the fit, words that were told, and faults that were warned
    of.
    """
    told, warned = [], []
    usual = {
        "options": SearchOptions(),
        "join": None,
        "columns": None,
        "gravity": None,
        "despite_faults": False,
    }
    words = {**usual, **changed}
    report = identify_files(
        FlightFiles(
            fit=names,
            held_out=held_out,
            join=words.pop("join"),
            columns=words.pop("columns"),
        ),
        START,
        words.pop("options"),
        warn=warned.append,
        progress=lambda *done, **last: told.append((*done, *last.values())),
        **words,
    )
    return report, told, warned


def test_files_are_read_one_after_the_other_and_the_held_out_ones_are_predicted(
    asked, files
):
    report, told, warned = of_files("a.csv", "b.csv", held_out=["c.csv"])
    assert told[:5] == [
        (0, 3, "read a.csv"),
        (1, 3, "read b.csv"),
        (2, 3, "read c.csv"),
        (),
        ("look for faults",),
    ]
    assert [each.name for each in report.flights] == ["a", "b"]
    assert asked.predicted[0][0] == ["c"]
    assert asked.predicted[0][2] == ["a", "b"]
    assert (report.start, report.known, report.clocks, report.faults, warned) == (
        START,
        {},
        {},
        [],
        [],
    )


def test_flights_of_which_no_part_counts_are_not_in_the_report(
    asked, files, monkeypatch
):
    monkeypatch.setattr(
        flights_of, "identify_by_windows", lambda *_: found((False, True))
    )
    report, _, warned = of_files("a.csv", "b.csv")
    assert [each.name for each in report.flights] == ["b"]
    assert (
        [each.file for each in warned]
        == [each.file for each in report.faults]
        == ["a.csv"]
    )


def test_the_first_of_the_files_is_joined_with_another_computer_s(
    asked, files, monkeypatch
):
    monkeypatch.setattr(
        files_of,
        "join_flights",
        lambda one, other: (
            dataclasses.replace(one, name=f"{one.name}{other.name}"),
            CLOCK,
        ),
    )
    report, *_ = of_files("a.csv", held_out=["b.csv"], join="c.csv")
    assert [each.name for each in report.flights] == ["ac"]
    assert asked.predicted[0][0] == ["b"]
    assert report.clocks == {"ac": CLOCK}


def test_the_voltage_of_the_rotors_data_is_no_number_of_the_search(asked, files):
    known = {"voltage": 12.5, "delay": 0.0}
    with pytest.raises(
        ValueError,
        match=(
            r"^--known voltage = 12\.5: must be left out: no flight measures the"
            r" voltage$"
        ),
    ):
        of_files("a.csv", held_out=["b.csv"], options=SearchOptions(known=known))
    volts = dataclasses.replace(files["b.csv"]["gyro"], values=np.full((1001, 1), 12.0))
    files["b.csv"] = files["b.csv"].with_channels({"voltage": volts})
    report, *_ = of_files("a.csv", "b.csv", options=SearchOptions(known=known))
    options = asked.fitted[0][2]
    assert (options.full_voltage, options.known) == (12.5, {"delay": 0.0})
    assert report.known == known


@pytest.mark.parametrize(
    ("stated", "given", "felt"),
    [({}, None, 9.81), ({"gravity": 9.7}, None, 9.7), ({"gravity": 9.7}, 1.62, 1.62)],
)
def test_gravity_is_given_or_that_of_the_flights_or_the_usual_one(
    asked, files, stated, given, felt
):
    files["b.csv"] = dataclasses.replace(files["b.csv"], facts=stated)
    of_files("a.csv", "b.csv", gravity=given)
    assert asked.fitted[0][2].gravity == felt


def test_flights_of_two_gravities_need_one_that_is_given(asked, files):
    for name, value in (("a.csv", 9.7), ("c.csv", 9.75)):
        files[name] = dataclasses.replace(files[name], facts={"gravity": value})
    with pytest.raises(
        ValueError,
        match=(
            r"^--gravity: is missing: the flights state several, m/s\^2: a 9\.7, c"
            r" 9\.75$"
        ),
    ):
        of_files("a.csv", "b.csv", held_out=["c.csv"])
    alike = [dataclasses.replace(files[each], name="a") for each in ("a.csv", "c.csv")]
    with pytest.raises(ValueError, match=r"flights state several, m/s\^2: a 9\.7, a"):
        files_of._gravity(alike)


@pytest.mark.parametrize(
    ("section", "words"),
    [
        ((10.0, 20.0), "--begin = 10: must be below 10 s, the end of a"),
        ((-5.0, 2.0), "--end = 2: must be above 2 s, the start of b"),
        ((9.99, 20.0), ""),
    ],
)
def test_sections_lie_within_every_flight_of_the_fit(asked, files, section, words):
    files["b.csv"] = flight("b", 2, begin=2.0)
    options = SearchOptions(sections=[section])
    if words:
        with pytest.raises(ValueError, match=f"^{words}$"):
            of_files("a.csv", "b.csv", options=options)
    else:
        of_files("a.csv", "b.csv", options=options)


def test_a_measurement_counts_once(asked, files):
    with pytest.raises(
        ValueError,
        match=r"^--held-out = '\./a\.csv': must not be among the flights of the fit$",
    ):
        of_files("a.csv", held_out=["./a.csv"])
    files["b.csv"] = dataclasses.replace(files["a.csv"], name="b", file="b.csv")
    with pytest.raises(
        ValueError,
        match=r"^flight = 'b\.csv': must be another measurement than 'a\.csv'$",
    ):
        of_files("a.csv", "b.csv")


def test_a_refused_fault_of_a_file_is_in_the_report_only_if_it_is_flown_despite(
    asked, files
):
    asked.faults = (fault(REFUSED), fault())
    with pytest.raises(ValueError, match="is odd"):
        of_files("a.csv")
    report, _, warned = of_files("a.csv", despite_faults=True)
    assert warned == report.faults == [fault(REFUSED), fault()]


@pytest.mark.parametrize("name", SCALED)
def test_numbers_of_the_first_rotor_keep_the_ratios_of_the_others(name):
    """A rotor that has 1.3 times the number at the start has it afterwards; alike ones
    have what was found, exactly.
    """
    start = skyarm.load_vehicle("hummingbird_arm2_rotors")
    first, second, *rest = start.rotors
    odd = dataclasses.replace(second, **{name: 1.3 * float(getattr(second, name))})
    found = 1.1 * float(getattr(first, name))
    for checked in (False, True):
        vehicle = vehicle_with(
            start.with_checked(rotors=(first, odd, *rest)),
            {f"rotors.{name}": found},
            checked=checked,
        )
        values = [float(getattr(rotor, name)) for rotor in vehicle.rotors]
        assert values[1] == pytest.approx(1.3 * found, rel=1e-12)
        assert [values[0], *values[2:]] == [found] * 3
