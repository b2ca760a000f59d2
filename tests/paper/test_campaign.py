"""Flights on one process or several give the same bits; variations are what they
say.
"""

from __future__ import annotations

import dataclasses
import os
import signal
import threading
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pytest

from skyarm.paper import inferred_settings
from skyarm.paper import reproduce as room
from skyarm.paper.flights import (
    STATED,
    PaperFlight,
    flights,
    metrics,
    scenario,
    with_damping,
    work_of,
)
from skyarm.paper.published import CASES
from skyarm.paper.reproduce import NAMED, Campaign, Drawing, run_campaign, works
from skyarm.paper.variations import (
    DAMPINGS,
    Variation,
    damped_first_joint,
    delay_commands,
    reshaped_ramps,
    variations,
)
from skyarm.reference import sequence
from skyarm.scenario.scenario_record import PLANTS
from skyarm.simulate import Log, run
from skyarm.studies.flights import Store, Work
from skyarm.studies.flights.fly import fly
from skyarm.studies.flights.store import pack_rows, unpack_rows
from support.logs import all_logs

CASE2, WIND = (
    PaperFlight("case2", "PD", "rigid_body"),
    PaperFlight("case3_wind", "PD", "mujoco"),
)
FEW = [
    work_of(CASE2, scenario(CASE2)),
    work_of(WIND, scenario(WIND)),
    work_of(CASE2, with_damping(scenario(CASE2), 0.005), "joint_damping 0.005"),
]


def _variation(group: str, value: str) -> Variation:
    return next(
        each for each in variations() if (each.group, each.value) == (group, value)
    )


def _equal(a: Campaign, b: Campaign) -> bool:
    logs = zip(a.all_logs(), b.all_logs(), strict=True)
    same = all(_same(one, other) for one, other in logs)
    return same and (repr(a.found), repr(a.sensitivity)) == (
        repr(b.found),
        repr(b.sensitivity),
    )


def _same(a: Log, b: Log) -> bool:
    return a.info == b.info and all(
        np.array_equal(a.arrays()[name], b.arrays()[name]) for name in a.arrays()
    )


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(room, "works", lambda *_, **__: list(FEW))


@pytest.mark.usefixtures("few")
def test_two_workers_give_the_bits_of_one() -> None:
    told: list[tuple[int, int, str]] = []
    alone = run_campaign(PLANTS, sensitivity=False)
    shared = run_campaign(
        PLANTS, sensitivity=False, workers=2, progress=lambda *words: told.append(words)
    )
    assert _equal(alone, shared)
    assert len(alone.all_logs()) == 2
    assert _same(alone.logs["rigid_body"]["case2"]["PD"], run(scenario(CASE2))), (
        "a kept log is the flight's"
    )
    assert [t[:2] for t in told] == [(1, 3), (2, 3), (3, 3)]
    assert {t[2] for t in told} == {work.label for work in FEW}


def test_pictures_are_drawn_between_flights_once_those_that_they_show_have_landed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(room, "works", lambda *_, **__: [FEW[1], FEW[0], FEW[2]])
    landed, steps = list[str](), list[tuple[int, list[str]]]()

    class Steps(Drawing):
        def step(self, logs: Any) -> bool:
            steps.append(
                (
                    len(landed),
                    [f"{case} {law}" for case, laws in logs().items() for law in laws],
                )
            )
            return True

    options = {"progress": lambda *words: landed.append(words[2]), "drawing": Steps()}
    run_campaign(PLANTS, sensitivity=False, **options)
    assert steps == [(2, ["case2 PD"]), (3, ["case2 PD"])]


def test_each_picture_is_drawn_once_the_same_at_any_pace(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    drawn = list[float]()
    monkeypatch.setattr(
        room,
        "image_bytes",
        lambda _, dpi=0.0: drawn.append(dpi) or str(len(drawn)).encode(),
    )
    drawing, logs = Drawing(), all_logs()["rigid_body"]
    assert drawing.step(lambda: logs)
    assert (sorted(drawing.files), sorted(drawing.shown), drawn) == (
        ["figure_03"],
        ["figure_03"],
        [room.DPI, 0.0],
    )
    while drawing.step(lambda: pytest.fail("the logs are read once")):
        pass
    assert not drawing.step(dict)
    assert set(drawing.files) == set(NAMED)
    flown = {f"{case}_{kind}" for case in CASES for kind in ("tracking", "tip")} | {
        "case3_path"
    }
    assert set(drawing.shown) == set(NAMED) | flown
    assert len(drawn) == len(drawing.files) + len(drawing.shown)


def test_a_picture_that_cannot_be_drawn_ends_no_campaign_and_is_said_in_the_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(room, "works", lambda *_, **__: list(FEW))
    monkeypatch.setattr(room, "paper_figures", lambda *_: {})
    monkeypatch.setattr(room, "overview_figure", lambda *_: None)

    def fail(*_: Any, **__: Any) -> bytes:
        raise OSError("no font")

    monkeypatch.setattr(room, "image_bytes", fail)
    drawing = Drawing()
    assert len(run_campaign(PLANTS, sensitivity=False, drawing=drawing).all_logs()) == 2
    for _ in range(2):
        with pytest.raises(OSError, match="no font"):
            drawing.step(dict)


@pytest.mark.usefixtures("few")
def test_of_flights_that_were_kept_nothing_is_drawn_before_others_fly(
    tmp_path: Path,
) -> None:
    steps = list[str]()

    class Steps(Drawing):
        def step(self, logs: Any) -> bool:
            steps.append("step")
            return True

    for drawn in (3, 3):
        run_campaign(
            PLANTS, sensitivity=False, store=Store(tmp_path / "kept"), drawing=Steps()
        )
        assert len(steps) == drawn


def test_a_figure_is_arranged_once_whatever_a_user_has_set(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    logs = {"case1": all_logs()["rigid_body"]["case1"]}
    monkeypatch.setattr(
        room, "overview_figure", lambda *_: room.paper_figures(logs, {})[3]
    )
    shown = []
    for tight in (False, True):
        with matplotlib.rc_context({"figure.autolayout": tight}):
            drawing = Drawing()
            drawing.step(lambda: logs)
        shown.append((drawing.files, drawing.shown))
    assert shown[0] == shown[1]


def _killed(log: Log) -> dict[str, float]:
    del log
    os.kill(os.getpid(), signal.SIGKILL)
    return {}


def test_a_worker_that_dies_is_an_error_and_not_a_hang(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    short = dataclasses.replace(scenario(CASE2), duration=0.1)
    dying = dataclasses.replace(FEW[0], scenario=short, measure=_killed)
    monkeypatch.setattr(room, "works", lambda *_, **__: [dying])
    monkeypatch.setattr("skyarm.studies.flights.processes.MOST_TRIES", 1)
    with pytest.raises(OSError, match="workers = 2: a process ended unexpectedly"):
        run_campaign(PLANTS, workers=2, on="processes")


@pytest.mark.thorough
@pytest.mark.usefixtures("few")
def test_workers_start_from_a_thread_too() -> None:
    before = signal.getsignal(signal.SIGINT)
    results: list[Any] = []
    thread = threading.Thread(
        target=lambda: results.append(
            run_campaign(PLANTS, sensitivity=False, workers=2)
        )
    )
    thread.start()
    thread.join(timeout=120)
    assert len(results[0].all_logs()) == 2
    assert signal.getsignal(signal.SIGINT) is before


def _interrupted(done: int, total: int, label: str) -> None:
    del total, label
    if done == 1:
        raise KeyboardInterrupt


def test_an_interrupted_campaign_flies_only_what_is_missing_and_is_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("pyarrow")
    flown: list[str] = []
    two = [FEW[0], FEW[2]]
    monkeypatch.setattr(room, "works", lambda *_, **__: list(two))

    def noted(work: Work, threads: int = 1) -> Any:
        flown.append(work.label)
        return fly(work, threads)

    monkeypatch.setattr("skyarm.studies.flights.executor.fly", noted)
    whole = run_campaign(PLANTS, sensitivity=False, store=Store(tmp_path / "whole"))
    flown.clear()
    for _ in range(2):
        with pytest.raises(KeyboardInterrupt):
            run_campaign(
                PLANTS,
                sensitivity=False,
                store=Store(tmp_path / "cut"),
                progress=_interrupted,
            )
    again = run_campaign(PLANTS, sensitivity=False, store=Store(tmp_path / "cut"))
    assert flown == [work.label for work in two], "each once"
    assert _equal(again, whole)
    files = [
        {path.name: path.read_bytes() for path in (tmp_path / at / "rows").iterdir()}
        for at in ("whole", "cut")
    ]
    assert files[0] == files[1]
    assert len(files[0]) == 2


def test_there_are_twenty_flights() -> None:
    assert len(set(flights())) == 20
    assert {(f.case, f.controller, f.plant) for f in flights()} == {
        (case, controller, plant)
        for case in CASES
        for controller in ("CT", "PD")
        for plant in PLANTS
    }


def test_metrics_come_back_in_their_order_and_null_where_they_are_not_defined() -> None:
    campaign, log = Campaign(), run(scenario(CASE2))
    rows = fly(FEW[0])
    campaign.keep(FEW[0], unpack_rows(pack_rows(rows, {})))
    direct = metrics("case2", log)
    assert direct["settling_time"] is None
    assert repr(campaign.found) == repr(
        {STATED: {("case2", "PD", "rigid_body"): direct}}
    )


def test_a_campaign_files_every_flight_and_every_variation(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    flown: list[Work] = []

    def pretend(work: Work, metadata: dict[bytes, bytes], threads: int) -> bytes:
        del threads
        flown.append(work)
        number, log = (
            np.array([float(len(flown))]),
            np.array([work.label.encode()], dtype=object),
        )
        return pack_rows(
            {"peak_pitch": number, "end_time": number, "log": log}, metadata
        )

    monkeypatch.setattr("skyarm.studies.flights.executor.rows_file", pretend)
    monkeypatch.setattr(room, "log_from_npz", lambda content, _: content.decode())
    monkeypatch.setattr(
        inferred_settings, "inferred_scenario", lambda flight, _: scenario(flight)
    )
    found = run_campaign(PLANTS)
    numbers = {work.label: {"peak_pitch": float(k + 1)} for k, work in enumerate(flown)}
    assert len(numbers) == len(flown), "labels are unique"
    assert (
        sum(len(pair) for cases in found.logs.values() for pair in cases.values()) == 20
    )
    for plant, cases in found.logs.items():
        for case, controllers in cases.items():
            for controller, log in controllers.items():
                assert log == f"{case} {controller} {plant} (stated)"  # type: ignore[comparison-overlap]
                assert found.found["stated"][case, controller, plant] == numbers[log]
    groups: dict[str, list[str]] = {}
    for each in variations():
        groups.setdefault(each.group, []).append(each.value)
    assert {
        group: list(values) for group, values in found.sensitivity.items()
    } == groups, "in the order of the report"
    for each in variations():
        cells = found.sensitivity[each.group][each.value]
        assert list(cells) == list(each.cases)
        for case, pair in cells.items():
            of = "stated" if each.change is None else f"{each.group} {each.value}"
            assert pair == {
                law: numbers[f"{case} {law} rigid_body ({of})"] for law in ("CT", "PD")
            }, of
    assert set(found.sensitivity["joint_damping"]) == {
        f"{damping:g}" for damping in DAMPINGS
    }
    counts = {
        kind: len(cells) for kind, cells in found.found.items() if " " not in kind
    }
    assert counts == {"stated": 20, "inferred": 20, "predicted": 10}
    for kind, cells in found.found.items():
        for (case, controller, plant), cell in cells.items():
            assert cell == numbers[f"{case} {controller} {plant} ({kind})"]
    assert {work.label for work in flown if work.keeps_log} == {
        work.label for work in flown[:20]
    }, "no log for nothing"
    alone = run_campaign(PLANTS[:1], sensitivity=False, inferred=False)
    assert not alone.sensitivity
    assert list(alone.found) == ["stated"]


@pytest.mark.thorough
def test_every_flight_has_a_key_of_its_own() -> None:
    every = works(PLANTS, variations())
    assert len({work.key for work in every}) == len(every) == 114


def test_the_assumed_damping_is_that_of_the_table_and_needs_no_flight() -> None:
    plain = scenario(PaperFlight("case2", "CT", "rigid_body"))
    assert [float(link.joint.damping) for link in plain.plant.vehicle.links] == [
        0.001,
        0.001,
    ]
    assert _variation("joint_damping", "0.001").change is None
    assert all(
        _variation("joint_damping", f"{d:g}").change is not None
        for d in DAMPINGS
        if d != 0.001
    )


def test_a_variation_is_the_changed_scenario_measured(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(room, "flights", lambda _: [CASE2])
    _, varied = works(PLANTS, [_variation("joint_damping", "0.005")], inferred=False)
    campaign = Campaign()
    campaign.keep(varied, fly(varied))
    by_hand = metrics("case2", run(with_damping(scenario(CASE2), 0.005)))
    assert campaign.found == {
        "joint_damping 0.005": {("case2", "PD", "rigid_body"): by_hand}
    }
    assert by_hand != metrics("case2", run(scenario(CASE2)))


def test_damping_of_the_first_joint_leaves_the_second() -> None:
    varied = damped_first_joint(scenario(PaperFlight("case2", "CT", "rigid_body")))
    assert [float(link.joint.damping) for link in varied.plant.vehicle.links] == [
        0.05,
        0.001,
    ]


def test_damping_changes_the_truth_and_not_the_belief() -> None:
    plain = scenario(PaperFlight("case2", "CT", "rigid_body"))
    varied = with_damping(plain, 0.05)
    assert [float(link.joint.damping) for link in varied.plant.vehicle.links] == [
        0.05,
        0.05,
    ]
    assert varied.controller is plain.controller
    assert varied.reference is plain.reference


def test_latency_is_three_physics_steps() -> None:
    assert (
        delay_commands(scenario(PaperFlight("case1", "CT", "mujoco"))).delays.command
        == 0.003
    )


def test_other_ramps_have_the_heights_and_times_of_the_linear_ones() -> None:
    plain = scenario(PaperFlight("case1", "CT", "rigid_body"))
    smooth, stepped = reshaped_ramps(plain, "quintic"), reshaped_ramps(plain, "step")
    times = np.array([0.0, 6.0, 7.0, 11.9, 12.0, 13.0, 14.0, 18.0, 19.0, 20.0, 25.0])
    for t in times:
        a, b = plain.reference.at(float(t)), smooth.reference.at(float(t))
        assert [float(q) for q in a.joints] == pytest.approx(
            [float(q) for q in b.joints], abs=1e-12
        ), t
    # a quarter of the way: 10/64 - 15/256 + 6/1024 of the height; a step is there at
    # once
    assert float(smooth.reference.at(6.25).joints[0]) == pytest.approx(
        0.3 * (10 / 64 - 15 / 256 + 6 / 1024)
    )
    assert float(plain.reference.at(6.25).joints[0]) == pytest.approx(0.3 * 0.25)
    for t, height in (
        (5.99, 0.0),
        (6.02, 0.3),
        (11.99, 0.3),
        (12.02, 0.0),
        (13.02, -0.3),
        (18.99, -0.3),
        (19.02, 0.0),
    ):
        assert float(stepped.reference.at(t).joints[0]) == pytest.approx(
            height, abs=1e-12
        ), t
    linear = sequence(
        6.0, ((1.0, 0.3), (5.0, 0.3), (1.0, 0.0), (1.0, -0.3), (5.0, -0.3), (1.0, 0.0))
    )
    for t in np.arange(0.0, 30.0, 0.05):
        assert float(plain.reference.at(float(t)).joints[0]) == pytest.approx(
            float(linear.derivatives(float(t))[0]), abs=1e-12
        )


def test_variations_have_names_of_their_own() -> None:
    names = [(each.group, each.value) for each in variations()]
    assert len(set(names)) == len(names)


def test_only_what_the_table_assumes_is_no_variation() -> None:
    assumed = [(each.group, each.value) for each in variations() if each.change is None]
    assert assumed == [("joint_damping", "0.001"), ("ramp_shape", "linear")]
