"""Record of a flight outside: its log, periods that were missed, and percentiles."""

import dataclasses

import numpy as np
import pytest

from skyarm import load_scenario
from skyarm.algebra import Vec3
from skyarm.dynamics.actuators import Command
from skyarm.links.outside.flight_record import FlightRecord, percentiles
from skyarm.links.outside.outside_law import OutsideCommand
from skyarm.links.outside.rate_commands import RateCommand
from skyarm.log.formats import load_log, save_log
from skyarm.sensing.measurement import blank_measurement
from skyarm.simulate.check_endings import Ended

SCENARIO = load_scenario("case3")


def record(ticks):
    """Record whose rows have their own number for x, rotor speed and effort."""
    found, blank = FlightRecord(), blank_measurement(2, 4)
    for tick in ticks:
        given = OutsideCommand(
            base=RateCommand(rates=Vec3(0.0, 0.0, 0.0), thrust=0.4),
            law=Command(rotor_speeds=(100.0 + tick,) * 4, efforts=(float(tick), 0.0)),
        )
        seen = dataclasses.replace(blank, position=Vec3(float(tick), 0.0, 1.0))
        found.add(tick, seen, given)
    return found


def test_a_missed_period_has_the_row_before_it():
    log = record([0, 1, 4, 5]).log(SCENARIO, None, {"missed": 2})
    assert log.time == pytest.approx(np.arange(6) / 200.0)
    assert log.position[:, 0].tolist() == [0.0, 1.0, 1.0, 1.0, 4.0, 5.0]
    assert log.rotor_commands[:, 2].tolist() == [
        100.0,
        101.0,
        101.0,
        101.0,
        104.0,
        105.0,
    ]
    assert log.efforts[:, 0].tolist() == [0.0, 1.0, 1.0, 1.0, 4.0, 5.0]
    assert log.info["outside"] == {"missed": 2}
    assert log.status == "completed"


def test_a_flight_that_never_began_has_an_empty_log(tmp_path):
    log = record([]).log(SCENARIO, Ended("link_lost", "silence", 0.0), {})
    assert (len(log.time), log.status, log.info["cause"]) == (0, "link_lost", "silence")
    assert load_log(save_log(log, tmp_path / "empty.npz")).status == "link_lost"


def test_references_stand_beside_the_estimates():
    log = record(range(1400)).log(SCENARIO, None, {})
    assert log.position_reference[-1] == pytest.approx(
        [*map(float, SCENARIO.reference.at(1399 / 200.0).position)]
    )


def test_a_scenario_with_an_estimator_leaves_a_log():
    log = record(range(3)).log(load_scenario("hover_swing"), None, {})
    assert log.position[:, 0].tolist() == [0.0, 1.0, 2.0]


def test_percentiles_are_in_milliseconds():
    found = percentiles([0.001] * 98 + [0.002, 0.1])
    assert (found["count"], found["p50_ms"], found["max_ms"]) == (100, 1.0, 100.0)
    assert 1.9 < found["p99_ms"] < 5.0
    assert percentiles([]) == {"count": 0}
