"""The benchmark's own arithmetic; what it measures is never asserted."""

from __future__ import annotations

import dataclasses
import json
import os

import bench_counts as counts
import bench_engines as ours
import bench_timing as room
import growth
import measure_engines as report
import numpy as np
import peers
import pytest
from bench_engines import accuracy
from bench_timing import Contender, contest

from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing.lower import operations
from skyarm.scenario.controller_table import controller_by_name
from skyarm.scenario.scenario_file import load_scenario
from skyarm.simulate.engine import EpisodeCode
from skyarm.vehicle.vehicle_files import load_vehicle


@pytest.fixture(autouse=True)
def _cache(tmp_path, monkeypatch):
    monkeypatch.setenv("SKYARM_CACHE", str(tmp_path))


def test_contenders_run_in_turn_and_ratios_are_taken_within_a_round(monkeypatch):
    """A clock that we turn: B always takes a quarter of A's time, though the machine
    slows down by the round.
    """
    now, order, slowness = [0.0], [], {"A": 1.0, "B": 0.25}
    monkeypatch.setattr(room.time, "perf_counter", lambda: now[0])
    monkeypatch.setattr(room.time, "process_time", lambda: 2.0 * now[0])

    def runner(name):
        def run():
            order.append(name)
            now[0] += slowness[name] * (1 + order.count(name))
            return 6.0

        return Contender(name, name, run)

    a, b = contest([runner("A"), runner("B")], rounds=3)
    assert order == ["A", "B"] * 4
    assert (a.ratio, b.ratio, b.low, b.high) == (1.0, 4.0, 4.0, 4.0)
    assert b.work_ratio == 4.0
    assert a.work_rate == 0.5 * a.rate
    # 6 s simulated; the first, uncounted round took 2 s, the others 3, 4, 5
    assert a.rate == 6.0 / 4.0


def test_a_flight_flies_its_lanes_through_the_whole_scenario():
    scenario = load_scenario("case2", duration=0.1)
    flight = ours.Flight.of(scenario, ours.steps_of(scenario))
    carry, parameters = flight.lanes(5)
    assert carry.shape[1] == parameters.shape[1] == 5
    assert np.all(np.abs(parameters / flight.parameters[:, None] - 1.0) <= 0.02)
    kernel = Kernel(flight.loop, Lanes(1))
    end, _ = kernel.run(carry, parameters, flight.rows)
    assert end[1].tolist() == [20.0] * 5
    assert flight.runner(kernel, 5, 1)() == pytest.approx(0.5)


@pytest.mark.thorough
def test_rk4_strays_less_than_euler_and_double_less_than_single():
    found = accuracy(load_scenario("case2"), 0.5)
    assert 0.0 < found["rk4 f64 exact"] < 1e-6
    assert found["rk4 f64 exact"] < found["rk4 f32"]
    assert found["rk4 f64 exact"] < 0.1 * found["euler f64 exact"]
    assert found["euler f64 exact"] < 1e-2


def test_counts_fall_where_a_vehicle_has_no_arm():
    bare, armed = (
        counts.counts(load_vehicle("hummingbird")),
        counts.counts(load_vehicle("hummingbird_arm2_rotors")),
    )
    assert set(bare) == set(armed)
    assert all(bare[name] < armed[name] for name in bare)
    assert "euler step" not in counts.counts(load_vehicle("hummingbird_arm2"))


def test_operations_of_the_truth_vehicle_do_not_creep_up():
    """Budgets of the general tree code, measured when they were set: raise them only
    with a reason.

    222 of the step of semi-implicit Euler are the rotors' mean thrust and spin in it:
    it holds forces for a step. 175 are the joints' friction at the end of the step, by
    which it is stable however quick the friction is.
    """
    found = counts.counts(load_vehicle("hummingbird_arm2_rotors"))
    assert found["forward dynamics"] <= 318
    assert found["inverse dynamics"] <= 223
    assert found["euler step"] <= 689 + 222 + 175
    assert found["rk4 step"] <= 2556


def test_operations_of_the_flagship_do_not_creep_up():
    """A period of the loop, plant and sensors included: raise it only with a reason.

    47 of them are the logged force of moving air; code that writes no log leaves them
    out. 295 are sines of headings to come, by which the preview turns. 563 are the
    accelerometer, the noise of two sensors, levers of a bent arm and sines of its
    joints, less what they replace. 81 let load and friction be learned in the measured
    motion. 281 find readings that repeat, leap or disagree, blows, and joints that
    stick or yield.
    """
    scenario = load_scenario("case3_wind")
    flagship = dataclasses.replace(
        scenario, controller=controller_by_name(scenario, "centroidal_tip")
    )
    program = EpisodeCode(flagship, commands=False, effort=0).loop.program
    assert operations(program.nodes) <= 11248 + 47 + 295 + 563 + 81 + 281


def test_operations_of_two_vehicles_that_hold_a_bar_do_not_creep_up():
    """Both pushes of a step share what depends on the positions alone: 96 operations
    more where they do not.
    """
    program = EpisodeCode(
        load_scenario("two_hold_a_bar"), commands=False, effort=0
    ).loop.program
    assert operations(program.nodes) <= 14227


def test_growth_measures_arms_of_any_length():
    rows = growth.growth(load_vehicle("hexarotor_arm6"), (0, 1))
    assert [row["joints"] for row in rows] == [0, 1]
    assert rows[0]["operations"] < rows[1]["operations"]


def test_the_machine_is_described():
    found = room.describe()
    assert found["cores"] >= 1
    assert found["processor"]
    json.dumps(found)


@pytest.mark.thorough
def test_environments_are_stepped_with_drawn_actions(monkeypatch):
    pytest.importorskip("gymnasium", reason="the extra gym is not installed")
    *_, bare = peers.environments(peers.Extent(worlds=3, steps=5))
    assert (bare.name, bare.run()) == ("env no arm", 15.0)
    monkeypatch.setattr(peers, "installed", lambda name: name != "gymnasium")
    assert peers.environments() == []


def test_the_report_shows_every_number_it_is_given():
    score = {
        "name": "engine",
        "what": "words",
        "rate": 10.0,
        "ratio": 2.0,
        "low": 1.5,
        "high": 2.5,
        "work_rate": 5.0,
        "work_ratio": 3.0,
    }
    about = room.describe()
    text = report.text(
        {
            "machine": about,
            "scenario": {"name": "case", "rounds": 3},
            "speed": [score],
            "accuracy_m": {"rk4": 1.5e-9},
            "latency": {"compiled": {"p50_us": 0.25, "p99_us": 0.31}},
            "start_s": {"empty_cache": 0.5},
            "operations": {"vehicle": {"euler step": 819}},
        }
    )
    for piece in ("engine", "2x", "3x", "1.50e-09", "0.25", "0.31", "0.50", "819"):
        assert piece in text


@pytest.mark.skipif(not hasattr(os, "getloadavg"), reason="this system tells no load")
def test_the_load_of_the_last_minute_is_told_to_two_digits(monkeypatch):
    monkeypatch.setattr(os, "getloadavg", lambda: (1.23456, 7.0, 9.0))
    assert room.describe()["load_before"] == 1.23


@pytest.mark.parametrize(
    ("name", "double", "before"), [("f64", True, False), ("f32", False, True)]
)
def test_jax_computes_in_the_named_precision_and_then_as_before(name, double, before):
    jax = pytest.importorskip("jax")
    usual = jax.config.read("jax_enable_x64")
    try:
        jax.config.update("jax_enable_x64", before)
        with peers._precision(name):
            assert (jax.numpy.asarray([1.0]).dtype.itemsize == 8) == double
        assert jax.config.read("jax_enable_x64") == before
        with pytest.raises(RuntimeError, match="within"), peers._precision(name):
            raise RuntimeError("within")
        assert jax.config.read("jax_enable_x64") == before
    finally:
        jax.config.update("jax_enable_x64", usual)
