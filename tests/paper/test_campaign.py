"""Flights on one process or several give the same bits; variations are what they say."""

from __future__ import annotations

import os
import signal
import threading
from typing import Any

import numpy as np
import pytest

from skyarm.paper import reproduce as room
from skyarm.paper.flights import Flight, flights, metrics, scenario, with_damping
from skyarm.paper.published import CASES
from skyarm.paper.reproduce import Job, _perform_all, perform, run_campaign
from skyarm.paper.variations import (
    DAMPINGS,
    damped_first_joint,
    delay_commands,
    reshaped_ramps,
    variation,
    variations,
)
from skyarm.reference import sequence
from skyarm.scenario.scenario_record import PLANTS
from skyarm.simulate import Log, run

FEW = [
    Job(Flight("case1", "CT", "rigid_body")),
    Job(Flight("case3_wind", "PD", "mujoco")),
    Job(Flight("case2", "PD", "rigid_body"), "joint_damping", "0.005"),
]


def _equal(a: Any, b: Any) -> bool:
    if isinstance(a, Log):
        return a.info == b.info and all(np.array_equal(a.arrays()[name], b.arrays()[name]) for name in a.arrays())
    return bool(a == b)


def test_two_workers_give_the_bits_of_one() -> None:
    told: list[tuple[int, int, str]] = []
    alone = _perform_all(FEW, 1, None)
    shared = _perform_all(FEW, 2, lambda done, total, label: told.append((done, total, label)))
    assert set(alone) == set(shared) == set(FEW)
    for job in FEW:
        assert _equal(alone[job], shared[job]), job.label
    assert [t[:2] for t in told] == [(1, 3), (2, 3), (3, 3)]
    assert {t[2] for t in told} == {job.label for job in FEW}


def _killed(job: Job) -> None:
    del job
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_worker_that_dies_is_an_error_and_not_a_hang(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(room, "perform", _killed)
    with pytest.raises(OSError, match="workers = 2: a process ended unexpectedly"):
        _perform_all(FEW, 2, None)


@pytest.mark.thorough
def test_workers_start_from_a_thread_too() -> None:
    before = signal.getsignal(signal.SIGINT)
    results: list[Any] = []
    thread = threading.Thread(target=lambda: results.append(_perform_all(FEW[:2], 2, None)))
    thread.start()
    thread.join(timeout=120)
    assert len(results[0]) == 2
    assert signal.getsignal(signal.SIGINT) is before


def test_there_are_twenty_flights() -> None:
    assert len(set(flights())) == 20
    assert {(f.case, f.controller, f.plant) for f in flights()} == {
        (case, controller, plant) for case in CASES for controller in ("CT", "PD") for plant in PLANTS
    }


def test_a_campaign_files_every_flight_and_every_variation(monkeypatch: pytest.MonkeyPatch) -> None:
    flown: list[Job] = []

    def pretend(job: Job) -> Any:
        if job.kind:
            return job
        flown.append(job)
        return {"position_error_mean": float(len(flown))} if job.group else job

    monkeypatch.setattr(room, "perform", pretend)
    monkeypatch.setattr(room, "metrics", lambda *_: {})
    found = run_campaign(PLANTS)
    assert sum(len(pair) for cases in found.logs.values() for pair in cases.values()) == 20
    for plant, cases in found.logs.items():
        for case, controllers in cases.items():
            for controller, job in controllers.items():
                assert job.flight == Flight(case, controller, plant)  # type: ignore[attr-defined]
    groups: dict[str, list[str]] = {}
    for each in variations():
        groups.setdefault(each.group, []).append(each.value)
    assert {group: list(values) for group, values in found.sensitivity.items()} == groups, "in the order of the report"
    varied = [job for job in flown if job.group]
    assert {job.flight.plant for job in varied} == {"rigid_body"}
    changing = [each for each in variations() if each.change is not None]
    wanted = {(each.group, each.value, case, name) for each in changing for case in each.cases for name in ("CT", "PD")}
    assert {(job.group, job.value, job.flight.case, job.flight.controller) for job in varied} == wanted
    assert len(varied) == len(wanted)
    assert set(found.sensitivity["joint_damping"]) == {f"{damping:g}" for damping in DAMPINGS}
    assert set(found.sensitivity["joint_damping"]["0.02"]) == set(CASES)
    assert {kind: len(cells) for kind, cells in found.found.items()} == {"inferred": 20, "predicted": 10}
    for kind, cells in found.found.items():
        for (case, controller, plant), job in cells.items():
            assert (job.kind, job.flight) == (kind, Flight(case, controller, plant))  # type: ignore[attr-defined]
    alone = run_campaign(PLANTS[:1], sensitivity=False, inferred=False)
    assert not alone.sensitivity
    assert not alone.found


def test_the_assumed_damping_is_that_of_the_table_and_needs_no_flight() -> None:
    plain = scenario(Flight("case2", "CT", "rigid_body"))
    assert [float(link.joint.damping) for link in plain.plant.vehicle.links] == [0.001, 0.001]
    assert variation("joint_damping", "0.001").change is None
    assert all(variation("joint_damping", f"{d:g}").change is not None for d in DAMPINGS if d != 0.001)


def test_a_varied_job_is_the_changed_scenario_measured() -> None:
    flight = Flight("case2", "PD", "rigid_body")
    by_hand = metrics("case2", run(with_damping(scenario(flight), 0.005)))
    assert perform(Job(flight, "joint_damping", "0.005")) == by_hand
    assert by_hand != metrics("case2", run(scenario(flight)))


def test_damping_of_the_first_joint_leaves_the_second() -> None:
    varied = damped_first_joint(scenario(Flight("case2", "CT", "rigid_body")))
    assert [float(link.joint.damping) for link in varied.plant.vehicle.links] == [0.05, 0.001]


def test_damping_changes_the_truth_and_not_the_belief() -> None:
    plain = scenario(Flight("case2", "CT", "rigid_body"))
    varied = with_damping(plain, 0.05)
    assert [float(link.joint.damping) for link in varied.plant.vehicle.links] == [0.05, 0.05]
    assert varied.controller is plain.controller
    assert varied.reference is plain.reference


def test_latency_is_three_physics_steps() -> None:
    assert delay_commands(scenario(Flight("case1", "CT", "mujoco"))).delays.command == 0.003


def test_other_ramps_have_the_heights_and_times_of_the_linear_ones() -> None:
    plain = scenario(Flight("case1", "CT", "rigid_body"))
    smooth, stepped = reshaped_ramps(plain, "quintic"), reshaped_ramps(plain, "step")
    times = np.array([0.0, 6.0, 7.0, 11.9, 12.0, 13.0, 14.0, 18.0, 19.0, 20.0, 25.0])
    for t in times:
        a, b = plain.reference.at(float(t)), smooth.reference.at(float(t))
        assert [float(q) for q in a.joints] == pytest.approx([float(q) for q in b.joints], abs=1e-12), t
    # a quarter of the way: 10/64 - 15/256 + 6/1024 of the height; a step is there at once
    assert float(smooth.reference.at(6.25).joints[0]) == pytest.approx(0.3 * (10 / 64 - 15 / 256 + 6 / 1024))
    assert float(plain.reference.at(6.25).joints[0]) == pytest.approx(0.3 * 0.25)
    for t, height in ((5.99, 0.0), (6.02, 0.3), (11.99, 0.3), (12.02, 0.0), (13.02, -0.3), (18.99, -0.3), (19.02, 0.0)):
        assert float(stepped.reference.at(t).joints[0]) == pytest.approx(height, abs=1e-12), t
    linear = sequence(6.0, ((1.0, 0.3), (5.0, 0.3), (1.0, 0.0), (1.0, -0.3), (5.0, -0.3), (1.0, 0.0)))
    for t in np.arange(0.0, 30.0, 0.05):
        assert float(plain.reference.at(float(t)).joints[0]) == pytest.approx(
            float(linear.derivatives(float(t))[0]), abs=1e-12
        )


def test_variations_have_names_of_their_own_that_find_them() -> None:
    names = [(each.group, each.value) for each in variations()]
    assert len(set(names)) == len(names)
    for group, value in names:
        found = variation(group, value)
        assert (found.group, found.value) == (group, value)


def test_only_what_the_table_assumes_is_no_variation() -> None:
    assumed = [(each.group, each.value) for each in variations() if each.change is None]
    assert assumed == [("joint_damping", "0.001"), ("ramp_shape", "linear")]
