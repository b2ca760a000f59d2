"""A flight in machine code leaves the log of the loop in Python, whole and to the last
bit, however it is cut up.
"""

from __future__ import annotations

import csv
import dataclasses
import io
import math
import os
import signal
import sys
import threading
import tracemalloc
from typing import Any

import numpy as np
import pytest

from skyarm.algebra import Quaternion, Vec3
from skyarm.algebra.scalars import where
from skyarm.algebra.scalars.philox import uniforms
from skyarm.compile.machine_code import NoMachineCodeError, SlowFlightWarning
from skyarm.dynamics.actuators import Command
from skyarm.records.leaves import leaves
from skyarm.scenario.scenario_file import load_scenario, scenario_from
from skyarm.scenario.scenario_record import first_state
from skyarm.simulate import Log, Scenario, draws, run
from skyarm.simulate import engine as native
from skyarm.simulate.loop import run_in_python
from support.cases import sampled
from support.flights import document, fly, shared_programs

NOISE = {
    "position": 0.003,
    "velocity": 0.02,
    "attitude": 0.004,
    "rate": 0.03,
    "joints": 0.002,
    "rotor_speeds": 1.0,
}
TURBULENT = {
    "mode": "moving_air",
    "velocity": [1.0, 0.5, 0.0],
    "gust": {
        "velocity": [0.0, 1.0, 0.0],
        "start": 0.3,
        "duration": 0.5,
        "shape": "one_minus_cosine",
    },
    "turbulence": {"altitude": 6.0, "wind_20ft": 7.7},
}
GUST = {
    "mode": "force_wind",
    "gust": {"force": [2.0, 0.0, 0.0], "start": 0.15, "duration": 0.1},
}


@pytest.fixture(autouse=True, scope="module")
def _shared():
    with shared_programs():
        yield


def planned(name: str = "case2", **changes: Any) -> Scenario:
    return scenario_from(document(name, **changes), "test")


def with_joint_limits(scenario: Scenario, limit: float) -> Scenario:
    vehicle = scenario.plant.vehicle
    links = [
        dataclasses.replace(
            k, joint=dataclasses.replace(k.joint, lower=-limit, upper=limit)
        )
        for k in vehicle.links
    ]
    world = dataclasses.replace(
        scenario.plant, vehicle=dataclasses.replace(vehicle, links=tuple(links))
    )
    return dataclasses.replace(scenario, plant=world)


def with_law(scenario: Scenario, value: float) -> Scenario:
    """A controller whose first rotor is asked for ``value`` from 0.1 s on."""

    def law(
        memory: Any, measurement: Any, reference: Any, dt: Any, *, par: Any
    ) -> tuple[Any, Command]:
        del reference, dt, par
        late = where(measurement.time > 0.0999, value, 485.0)
        return memory, Command(
            rotor_speeds=(late, 485.0, 485.0, 485.0), efforts=(0.0, 0.0)
        )

    return dataclasses.replace(
        scenario, controller=dataclasses.replace(scenario.controller, law=law)
    )


def with_gains_far_too_large(scenario: Scenario) -> Scenario:
    par = scenario.controller.par
    gains = dataclasses.replace(par.gains, attitude=par.gains.attitude * 400.0)
    controller = dataclasses.replace(
        scenario.controller, par=dataclasses.replace(par, gains=gains)
    )
    return dataclasses.replace(scenario, controller=controller, ground=False)


def pitched(degrees: float, rate: float) -> Scenario:
    """The Euler form started at a pitch and turning: it passes 90 degrees in flight."""
    high = document("case1", duration=0.5, reference__base__position=[0.0, 0.0, 100.0])
    base = scenario_from(high, replaced={"controller": "bulut2019"})
    half = math.radians(degrees) / 2
    start = dataclasses.replace(
        first_state(base),
        quaternion=Quaternion(math.cos(half), 0.0, math.sin(half), 0.0),
    )
    return dataclasses.replace(
        base, initial=dataclasses.replace(start, rate=Vec3(0.0, rate, 0.0))
    )


def on(vehicle: str, joints: int) -> Scenario:
    return planned(
        "case3",
        duration=0.2,
        plant={"vehicle": vehicle},
        model={"vehicle": vehicle},
        controller={"law": "hybrid_computed_torque", "mixer": "priority"},
        reference={
            "base": {"kind": "hover", "position": [0.0, 0.0, 2.0]},
            "joints": [0.1] * joints,
        },
        sensors=NOISE,
    )


FLIGHTS: dict[str, tuple[str, Any]] = {
    **{
        name: ("completed", lambda name=name: load_scenario(name, duration=1.0))
        for name in ("case1", "case2", "case3")
    },
    "gust of force": (
        "completed",
        lambda: planned(duration=0.5, environment__wind=GUST),
    ),
    "every table": ("completed", lambda: planned("everything", duration=0.3)),
    "noise, delays, turbulence": (
        "completed",
        lambda: planned(
            "case3_wind",
            duration=1.0,
            sensors=NOISE,
            delays={"measurement": 0.005, "command": 0.003},
            environment__wind=TURBULENT,
            seed=2**32 - 1,
            episode=7,
        ),
    ),
    "euler": ("completed", lambda: planned(duration=0.5, plant__integrator="euler")),
    "one period": ("completed", lambda: planned(duration=0.005)),
    "no joints": ("completed", lambda: on("hummingbird", 0)),
    "six joints": ("completed", lambda: on("hexarotor_arm6", 6)),
    "gains far too large": (
        "diverged",
        lambda: with_gains_far_too_large(load_scenario("case2_gust", duration=30.0)),
    ),
    "infinite command": ("diverged", lambda: with_law(planned(duration=0.5), math.inf)),
    "undefined command": (
        "diverged",
        lambda: with_law(planned(duration=0.5), math.nan),
    ),
    "undefined at once": (
        "diverged",
        lambda: planned(duration=0.5, initial={"velocity": [1e5, 0.0, 0.0]}),
    ),
    "ground": (
        "ground",
        lambda: planned(
            duration=0.5,
            initial={"position": [0.0, 0.0, 0.35], "velocity": [0.0, 0.0, -1.0]},
        ),
    ),
    "under the ground at once": (
        "ground",
        lambda: planned(duration=0.5, reference__base__position=[0.0, 0.0, 0.1]),
    ),
    "joint limit": (
        "joint_limit",
        lambda: with_joint_limits(
            planned(duration=0.5, initial={"joint_rates": [4.0, 0.0]}), 0.1
        ),
    ),
    "law undefined": (
        "controller_undefined",
        lambda: pitched(90.0 - math.degrees(0.015), 3.0),
    ),
}


def assert_same(ours: Log, theirs: Log) -> None:
    assert ours.info == theirs.info
    for name, array in ours.arrays().items():
        other = theirs.arrays()[name]
        assert array.shape == other.shape, name
        assert array.tobytes() == other.tobytes(), name


SAME = (
    "case1",
    "case2",
    "case3",
    "euler",
    "no joints",
    "six joints",
    "gust of force",
    "undefined command",
)
"""Flights whose features others of them have as well."""


@pytest.mark.parametrize(
    "what",
    sampled([*FLIGHTS], 100, keep=[name for name in FLIGHTS if name not in SAME]),
)
def test_the_log_of_machine_code_is_that_of_python_to_the_bit(what: str) -> None:
    status, make = FLIGHTS[what]
    scenario = make()
    ours = run(scenario)
    assert ours.status == status
    assert_same(ours, run_in_python(scenario))


@pytest.mark.parametrize("what", ["every table", "joint limit", "infinite command"])
def test_where_a_flight_is_cut_does_not_matter(what: str) -> None:
    scenario = FLIGHTS[what][1]()
    whole = fly(scenario)
    for stretch in (1, 7, 64):
        cut = native.Engine(whole.engine.code)
        while cut._fly(min(cut.tick + stretch, scenario.steps)):
            pass
        assert whole.rows.tobytes() == cut.recorder.table[: cut.tick].tobytes()
        assert repr(leaves(whole.carry)) == repr(leaves(cut.now))
        assert (
            (whole.engine.ended is None)
            == (cut.ended is None)
            == (what == "every table")
        )


def test_code_made_in_a_hurry_gives_the_same_numbers() -> None:
    scenario = FLIGHTS["noise, delays, turbulence"][1]()
    flights = [
        native.Engine(native.EpisodeCode(scenario, effort=effort)) for effort in (0, 2)
    ]
    for flight in flights:
        while flight.fly(scenario.steps):
            pass
    assert flights[0].tick == scenario.steps
    assert flights[0].recorder.table.tobytes() == flights[1].recorder.table.tobytes()


def test_the_effort_follows_the_work(monkeypatch: pytest.MonkeyPatch) -> None:
    efforts: list[int] = []
    kernel = native.Kernel
    monkeypatch.setattr(
        native,
        "Kernel",
        lambda *a, **k: efforts.append(k["written"].effort) or kernel(*a, **k),
    )
    native.EpisodeCode(s := planned())
    native.EpisodeCode(dataclasses.replace(s, duration=5000.0))
    assert efforts == [0, 2]


def test_without_a_compiler_it_flies_in_python_and_says_so(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scenario = planned(duration=0.25, sensors=NOISE)

    def refuse(*_: Any, **__: Any) -> None:
        raise NoMachineCodeError("no machine code here")

    with monkeypatch.context() as patch:
        patch.setattr(native, "Kernel", refuse)
        with pytest.warns(
            SlowFlightWarning,
            match="^no machine code here; flying as Python floats: about",
        ):
            slow = run(scenario)
    assert_same(slow, run(scenario))


def reports_of(scenario: Scenario) -> list[tuple[int, int]]:
    reports: list[tuple[int, int]] = []
    run(scenario, lambda done, total: reports.append((done, total)))
    return reports


def test_progress_grows_and_ends_complete_also_for_a_flight_that_ends_early() -> None:
    for what in ("every table", "ground", "one period", "under the ground at once"):
        scenario = FLIGHTS[what][1]()
        reports = reports_of(scenario)
        done = [d for d, _ in reports]
        assert reports[0] == (0, scenario.steps), what
        assert reports[-1] == (scenario.steps, scenario.steps), what
        assert done == sorted(set(done)), what
        assert len(reports) <= 101


def test_an_exception_of_the_listener_ends_the_flight() -> None:
    def stop(done: int, _total: int) -> None:
        if done > 100:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(planned(duration=5.0), stop)


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_ctrl_c_is_heard_while_machine_code_flies() -> None:
    """5000 Euler steps a period, over a second for each of the hundred calls of
    progress: heard in between.
    """
    slow = planned(
        duration=1000.0,
        plant__integrator="euler",
        rates={"physics": 1000000, "control": 200},
    )
    reports: list[int] = []
    heard = threading.Event()

    def press() -> None:
        # again if Python was just where it swallows exceptions (a finalizer), as a
        # person would
        for _ in range(5):
            if heard.wait(1.0):
                return
            os.kill(os.getpid(), signal.SIGINT)

    def note(done: int, _total: int) -> None:
        # pressed only once the flight is on its way, whatever the machine
        if not reports:
            threading.Thread(target=press, daemon=True).start()
        reports.append(done)

    # what other tests of this process made of the signal does not count here
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            run(slow, note)
        heard.set()
    finally:
        signal.signal(signal.SIGINT, before)
    assert reports[-1] < slow.steps / 2


def test_nothing_is_made_that_machine_code_makes_itself(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def never(*_: Any) -> None:
        raise AssertionError("tables of Python floats in a flight of machine code")

    steps = []

    def few(seed: int, episode: Any, channel: int, asked: Any, count: int) -> Any:
        steps.extend(np.ravel(asked).tolist())
        return uniforms(seed, episode, channel, asked, count)

    monkeypatch.setattr(native, "uniforms", never)
    monkeypatch.setattr(draws, "uniforms", few)
    # a seed of its own, whose first state nobody has made before
    assert (
        run(
            dataclasses.replace(FLIGHTS["noise, delays, turbulence"][1](), seed=8)
        ).status
        == "completed"
    )
    assert set(steps) == set(draws.STARTS), (
        "the flight's own numbers are drawn where it flies"
    )


def test_a_long_flight_needs_little_more_memory_than_its_log() -> None:
    """100 000 periods; the tables that fed it and the rows it left are what is more
    than the log: below 3 of it.
    """
    scenario = planned("case3_wind", duration=500.0, sensors=NOISE)
    run(dataclasses.replace(scenario, duration=0.1))
    tracemalloc.start()
    try:
        flown = run(scenario)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert flown.time.size == 100_000
    assert peak < 3.0 * sum(array.nbytes for array in flown.arrays().values())


def test_machine_code_and_endings_that_disagree_are_an_error_and_no_completed_flight(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(native, "find_ending", lambda *_: None)
    with pytest.raises(
        RuntimeError,
        match="an episode has ended in which no ending finds anything wrong",
    ):
        run(FLIGHTS["ground"][1]())


def test_a_csv_is_what_a_csv_writer_writes(tmp_path: Any) -> None:
    flown = run(FLIGHTS["noise, delays, turbulence"][1]())
    strange = flown.position.copy()
    strange[:6, 0] = [math.nan, math.inf, -math.inf, -0.0, 5e-324, 1e22]
    flown = dataclasses.replace(flown, position=strange, velocity=-strange)
    parts = [
        array[:, None] if array.ndim == 1 else array
        for array in flown.arrays().values()
    ]
    table = np.concatenate(parts, axis=1)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerows(table.tolist())
    heads, rows = (
        flown.save_csv(tmp_path / "log.csv").read_text(encoding="utf-8").split("\n", 1)
    )
    assert heads.count(",") + 1 == table.shape[1]
    assert rows == text.getvalue()


@pytest.mark.parametrize(
    ("seconds", "sizes"),
    # a period of 0.03 s: three of them are the longest stretch below 0.1 s
    [(0.03, [1, *[3] * 66, 1]), (1.0, [1] * 200), (1e-6, [1, 8, 64, 127])],
)
def test_machine_code_runs_for_a_tenth_of_a_second_at_a_stretch(
    monkeypatch: pytest.MonkeyPatch, seconds: float, sizes: list[int]
) -> None:
    scenario, clock, flown = planned(duration=1.0), [0.0], []
    engine = native.Engine(native.EpisodeCode(scenario))
    monkeypatch.setattr(native, "perf_counter", lambda: clock[0])

    def pretend(begin: int, end: int, _: int) -> None:
        clock[0] += seconds * (end - begin)
        flown.append(end - begin)

    monkeypatch.setattr(engine._stepper, "fly", pretend)
    while engine.fly(scenario.steps):
        pass
    assert flown == sizes
