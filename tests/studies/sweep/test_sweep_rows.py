"""Rows of a sweep: paired, the same however they are flown, and equal to single
runs.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from skyarm.log.metrics.windows import Windows
from skyarm.plant.joint_rate import friction_rate
from skyarm.plant.largest_step import FRICTION_STEP
from skyarm.records.leaves import leaves, rebuild
from skyarm.scenario.endings import PHASE_FAILED, STATUSES, Clearance
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_file import load_scenario, scenario_from
from skyarm.scenario.scenario_record import first_state
from skyarm.simulate import Window, run
from skyarm.simulate.batch import Batch
from skyarm.simulate.check_endings import LaneEnd, find_ending, statuses
from skyarm.studies.sweep.design import values
from skyarm.studies.sweep.plan import at_episode, prepare
from skyarm.studies.sweep.study import Study
from skyarm.world.contact import Contact, Surface
from support.cases import sampled
from support.logs import Errors, calmness, constant_wind, gust, last, motion, tracking
from support.studies import MASS, document, flown, same, small_study

pytest.importorskip("pyarrow")

STEADY, TRANSIENT = Window(0.2, 1.0), Window(0.0, 0.3)


def single(study: Study, controller: str, row: dict[str, Any], episode: int) -> Any:
    """Log of one episode flown alone."""
    return run(
        at_episode(
            study,
            controller,
            {path: row[path][episode] for path in study.paths},
            episode,
        )
    )


def metrics_of(log: Any) -> dict[str, float]:
    errors = Errors.held(log)
    return (
        tracking(log, errors, STEADY)
        | motion(log, STEADY)
        | constant_wind(log, errors, STEADY, TRANSIENT)
    )


def test_all_controllers_fly_the_same_draws_and_the_same_noise(tmp_path: Path) -> None:
    rows = flown(tmp_path, precision="bit_exact")
    ct, pd = rows["paper_ct"], rows["paper_pd"]
    assert ct["episode"].tolist() == pd["episode"].tolist() == list(range(50))
    for path in small_study().paths:
        assert np.array_equal(ct[path], pd[path])
        assert np.unique(ct[path]).size == 50
    assert not np.any(ct["joint_error_mean"] == pd["joint_error_mean"])
    # the same controller twice is the same to the bit: nothing depends on its place in
    # the list
    turned = flown(
        tmp_path / "turned", precision="bit_exact", controllers=["paper_pd", "paper_ct"]
    )
    assert same(ct, turned["paper_ct"])


@pytest.mark.parametrize("precision", sampled(["bit_exact", "double", "single"], 3))
def test_rows_do_not_depend_on_chunks_or_threads(
    tmp_path: Path, precision: str
) -> None:
    whole = flown(tmp_path / "whole", precision=precision, chunk=50)
    cut = flown(tmp_path / "cut", threads=2, precision=precision, chunk=7)
    assert list(whole) == list(cut) == ["paper_ct", "paper_pd"]
    assert all(same(whole[controller], cut[controller]) for controller in whole)


@pytest.mark.parametrize("bit_exact", [True, False])
@pytest.mark.parametrize("single_", [True, False])
def test_a_lane_is_the_same_at_every_vector_width(
    bit_exact: bool, single_: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As sweeps are compiled; without optimisation products of a lane alone are not
    fused into sums.
    """
    monkeypatch.setenv("SKYARM_EFFORT", "2")
    study = small_study(episodes=11)
    drawn = values(study, np.arange(11))
    found = []
    for width in (1, 4):
        monkeypatch.setattr(
            "skyarm.simulate.batch.host_width", lambda width=width, **_: width
        )
        batch = Batch(
            study.scenarios["paper_ct"],
            study.paths,
            bit_exact=bit_exact,
            single=single_,
        )
        found.append(batch.fly(drawn, seed=3))
    one, four = found
    assert all(
        np.array_equal(one.metrics[name], four.metrics[name], equal_nan=True)
        for name in one.metrics
    )
    assert np.array_equal(one.end_time, four.end_time)
    assert one.status.tolist() == four.status.tolist()


def test_rows_equal_single_runs(tmp_path: Path) -> None:
    study = small_study()
    for controller, rows in flown(tmp_path).items():
        ended = [int(k) for k in np.flatnonzero(rows["status"] != "completed")[:2]]
        assert ended, (
            "some flights must end early, or half of what is compared here is not there"
        )
        for episode in [*range(2), *ended]:
            log = single(study, controller, rows, episode)
            assert rows["status"][episode] == log.status
            assert rows["end_time"][episode] == log.info["end_time"]
            for name, value in metrics_of(log).items():
                if name in rows:
                    # fused multiply-adds round otherwise: 1e-16 a step, which the loop
                    # keeps small for half a second
                    assert rows[name][episode] == pytest.approx(
                        value, rel=1e-9, abs=1e-9, nan_ok=True
                    ), name


def test_turbulence_starts_anew_in_every_episode_as_in_a_single_run() -> None:
    air = {
        "mode": "moving_air",
        "velocity": [3.0, 0.0, 0.0],
        "turbulence": {"altitude": 20.0, "wind_20ft": 7.7},
    }
    text = dict(
        document_of_case1(),
        duration=1.0,
        environment={"wind": air},
        sensors={"rate": 0.01},
    )
    scenario = scenario_from(text)
    windows = Windows(steady=Window(0.2, 1.0), transient=Window(0.0, 0.3))
    batch = Batch(scenario, [MASS], windows=windows, bit_exact=True)
    masses = np.array([0.7, 0.75, 0.7])
    outcome = batch.fly({MASS: masses}, seed=8, episodes=np.array([5, 9, 6]))
    assert outcome.metrics["pitch_rms"][0] != outcome.metrics["pitch_rms"][2]
    for lane, episode in enumerate((5, 9, 6)):
        alone = dataclasses.replace(
            with_numbers(scenario, {MASS: float(masses[lane])}), seed=8, episode=episode
        )
        for name, value in metrics_of(run(alone)).items():
            if name in outcome.metrics:
                assert outcome.metrics[name][lane] == pytest.approx(
                    value, rel=1e-9, abs=1e-12
                ), name


def document_of_case1() -> dict[str, Any]:
    import tomllib

    from skyarm.scenario.scenario_file import LIBRARY

    found = tomllib.loads((LIBRARY / "case1.toml").read_text("utf-8"))
    del found["windows"]  # they end after 20 s
    return found


ON_ITS_SIDE = {
    "initial": {"quaternion_wxyz": [0.7071067811865476, 0.0, 0.7071067811865476, 0.0]}
}

ENDINGS = [
    ("ground", {}, {MASS: 9.0}),
    ("diverged", {}, {"initial.velocity.z": 5e3}),
    (
        "joint_limit",
        {},
        {"plant.vehicle.links.1.joint.upper": 0.02, "initial.joint_rates.1": 3.0},
    ),
    ("controller_undefined", ON_ITS_SIDE, {MASS: 0.73}),
    ("completed", {}, {MASS: 0.73}),
]


@pytest.mark.parametrize(
    ("status", "fields", "numbers"), ENDINGS, ids=[each[0] for each in ENDINGS]
)
@pytest.mark.parametrize("single_", [False, True])
def test_each_ending_has_the_status_and_time_of_a_single_run(
    status: str, fields: dict[str, Any], numbers: dict[str, float], single_: bool
) -> None:
    controller = "bulut2019" if status == "controller_undefined" else "paper_ct"
    scenario = scenario_from(
        {**document_of_case1(), **fields},
        replaced={"controller": controller, "duration": 1.0},
    )
    if scenario.initial is None:
        scenario = dataclasses.replace(scenario, initial=first_state(scenario))
    windows = Windows(steady=Window(0.8, 1.0), transient=Window(0.0, 0.8))
    log = run(with_numbers(scenario, numbers))
    assert log.status == status, log.info["cause"]
    outcome = Batch(scenario, list(numbers), windows=windows, single=single_).fly(
        {path: np.array([value] * 3) for path, value in numbers.items()}
    )
    assert outcome.status.tolist() == [status] * 3
    # single precision may end a period earlier or later
    assert outcome.end_time[0] == pytest.approx(
        log.info["end_time"], abs=0.0051 if single_ else 0.0
    )
    # no instant of an episode that ended early fell into the steady window
    alive = status == "completed"
    assert np.isfinite(outcome.metrics["position_error_mean"][0]) == alive
    assert np.isfinite(outcome.metrics["position_min"][0]) == alive


def test_a_lane_that_ends_in_its_last_period_is_not_completed() -> None:
    scenario = load_scenario("case1", duration=1.0)
    falls = {MASS: 9.0}
    end = run(with_numbers(scenario, falls)).info["end_time"]
    short = dataclasses.replace(with_numbers(scenario, falls), duration=end)
    assert run(short).status == "ground"
    outcome = Batch(dataclasses.replace(scenario, duration=end), [MASS]).fly(
        {MASS: np.array([9.0, 0.73])}
    )
    assert outcome.status.tolist() == ["ground", "completed"]
    assert outcome.end_time.tolist() == [end, end]


def test_statuses_are_those_of_single_runs_in_their_order() -> None:
    scenario = with_numbers(
        load_scenario("case1", controller="bulut2019"),
        {
            f"plant.vehicle.links.{i}.joint.{side}": sign
            for i in (0, 1)
            for side, sign in (("lower", -1.0), ("upper", 1.0))
        },
    )
    # a base at 0.6 m is in one ball, a level front rotor at 1 m in the other
    balls = [
        Surface(name=f"at {z}", shape="sphere", size=(0.02,), position=(x, 0.0, z))
        for x, z in ((0.0, 0.6), (0.17, 1))
    ]
    # a front rotor that is tilted by 0.3 rad is within 0.04 m of the second
    scenario = dataclasses.replace(
        scenario,
        world=Contact(surfaces=tuple(balls)),
        endings=(Clearance(margin=0.04),),
    )
    rng = np.random.default_rng(0)
    base = np.array(leaves(first_state(scenario)))
    states = np.repeat(base[None, :], 400, axis=0)
    # every cause alone and together with others: height, attitude, joints, rates,
    # distance, NaN
    states[:, 2] = rng.choice([1.0, 0.05, 0.6], 400)
    turn = rng.choice([0.0, 0.3, np.pi / 2], 400)
    states[:, 3:7] = np.stack(
        [np.cos(turn / 2), 0 * turn, np.sin(turn / 2), 0 * turn], axis=1
    )
    states[:, 13:15] = rng.choice(
        [0.0, 0.9, 1.1, -1.1], (400, 2), p=[0.5, 0.3, 0.1, 0.1]
    )
    states[:, 10] = rng.choice([0.0, 2e4, np.nan], 400, p=[0.8, 0.1, 0.1])
    states[:, 0] = rng.choice([0.0, 900.0, -2e3], 400, p=[0.8, 0.1, 0.1])
    goals = np.tile([0.0, 0.0, 1.0], (400, 1))
    wanted = [
        find_ending(scenario, 0.0, x, goal)
        for x, goal in zip(states.tolist(), goals.tolist(), strict=True)
    ]
    named = [ending.status if ending else "completed" for ending in wanted]
    # this vehicle has no shapes that may collide
    assert set(named) == set(STATUSES) - {PHASE_FAILED, "collision"}
    state = rebuild(first_state(scenario), iter(list(states.T)))
    assert (
        statuses(
            scenario, {}, [LaneEnd(state, goals, None)], np.zeros(400, dtype=bool)
        ).tolist()
        == named
    )
    # a phase that failed is the cause where nothing else is wrong
    failed = statuses(
        scenario,
        {},
        [LaneEnd(state, goals, np.arange(400) % 2 == 0)],
        np.zeros(400, dtype=bool),
    ).tolist()
    assert failed == [
        PHASE_FAILED if name == "completed" and k % 2 == 0 else name
        for k, name in enumerate(named)
    ]
    # a lane that stopped with nothing wrong in its state had a command that was not
    # finite
    stopped = statuses(
        scenario, {}, [LaneEnd(state, goals, None)], np.ones(400, dtype=bool)
    ).tolist()
    assert stopped == ["diverged" if each == "completed" else each for each in named]


def test_a_lane_that_machine_code_found_just_outside_a_limit_keeps_that_cause() -> None:
    scenario = with_numbers(
        load_scenario("case1"), {"plant.vehicle.links.0.joint.upper": 1.0}
    )
    state = first_state(scenario)
    inside = dataclasses.replace(
        state, joints=(np.array([1.0 - 1e-8]), np.array([0.0]))
    )
    lane = rebuild(
        inside, iter([np.broadcast_to(leaf, (1,)) for leaf in leaves(inside)])
    )
    goals = np.array([[0.0, 0.0, 1.0]])
    assert statuses(
        scenario, {}, [LaneEnd(lane, goals, None)], np.array([True])
    ).tolist() == ["joint_limit"]
    assert statuses(
        scenario, {}, [LaneEnd(lane, goals, None)], np.array([False])
    ).tolist() == ["completed"]


def test_a_stiff_episode_is_integrated_as_finely_beside_slack_ones_as_alone(
    tmp_path: Path,
) -> None:
    damping = "plant.vehicle.links.1.joint.damping"
    vary = {damping: {"grid": [0.001, 0.05, 2]}}
    study = small_study(vary=vary, design="grid", episodes=2, controllers=["paper_ct"])
    stiff = at_episode(study, "paper_ct", {damping: 0.05}, 1)
    assert 0.005 * friction_rate(stiff.plant.vehicle) / FRICTION_STEP > 2.0
    rows = flown(
        tmp_path, vary=vary, design="grid", episodes=2, controllers=["paper_ct"]
    )["paper_ct"]
    wanted = metrics_of(run(stiff))
    # the same steps, but for the rounding of fused multiply-adds
    assert rows["joint_error_mean"][1] == pytest.approx(
        wanted["joint_error_mean"], rel=1e-9
    )


def test_the_stiffest_plant_has_every_number_at_its_stiff_end() -> None:
    first, second = (f"plant.vehicle.links.{i}.joint.damping" for i in (0, 1))
    study = small_study(
        vary={first: {"uniform": [0.001, 0.01]}, second: {"uniform": [0.001, 0.02]}}
    )
    drawn = values(study, np.arange(50))
    joints = [
        link.joint.damping for link in prepare(study).stiffest.plant.vehicle.links
    ]
    assert joints == [drawn[first].max(), drawn[second].max()]


def test_the_integration_step_is_the_stiffest_episodes_whatever_the_chunk() -> None:
    damping = "plant.vehicle.links.1.joint.damping"
    study = small_study(
        vary={damping: {"uniform": [0.0001, 0.02]}}, controllers=["paper_ct"]
    )
    stiffest = prepare(study).stiffest
    assert (
        stiffest.plant.vehicle.links[1].joint.damping
        == values(study, np.arange(50))[damping].max()
    )
    light = small_study(vary={MASS: {"uniform": [0.3, 1.0]}}, controllers=["paper_ct"])
    assert (
        prepare(light).stiffest.plant.vehicle.base.mass
        == values(light, np.arange(50))[MASS].min()
    )


def test_all_joints_friction_at_once_and_a_payload_make_the_stiffest_plant() -> None:
    every, load = "plant.joints.damping", "plant.payload.mass"
    study = small_study(
        vary={every: {"uniform": [0.001, 0.02]}, load: {"uniform": [0.0, 0.05]}}
    )
    stiffest, drawn = (
        prepare(study).stiffest.plant.vehicle,
        values(study, np.arange(50)),
    )
    assert [link.joint.damping for link in stiffest.links] == [drawn[every].max()] * 2
    # what hangs on the tip makes the last link slower to stop
    assert stiffest.mass == study.scenarios["paper_ct"].plant.vehicle.mass


def test_a_study_without_varied_numbers_flies_other_noise_in_each_episode(
    tmp_path: Path,
) -> None:
    noisy = {**document_of_case1(), "sensors": {"position": 0.01}}
    path = tmp_path / "noisy.toml"
    path.write_text(_toml(noisy))
    rows = flown(tmp_path / "out", vary=None, scenario=str(path), controllers=None)[
        "hybrid_computed_torque"
    ]
    assert np.unique(rows["iae_position"]).size == 50


def _toml(table: dict[str, Any]) -> str:
    """The case1 file with sensors, as text."""
    from skyarm.scenario.scenario_file import LIBRARY

    return (LIBRARY / "case1.toml").read_text(
        "utf-8"
    ) + f"\n[sensors]\nposition = {table['sensors']['position']}\n"


def test_the_document_of_the_small_study_is_complete() -> None:
    assert small_study().document["vary"] == document()["vary"]


def test_rows_hold_the_metrics_of_the_study_and_a_varied_reference_is_flown(
    tmp_path: Path,
) -> None:
    radius = "reference.base.radius"
    windows = {
        "steady": [0.2, 1.0],
        "transient": [0.0, 0.3],
        "gust": [0.1, 0.9],
        "last": 0.4,
    }
    fields: dict[str, Any] = {
        "vary": {
            radius: {"uniform": [0.1, 0.5]},
            "reference.base.start": {"list": [0.1, 0.4]},
        },
        "metrics": ["gust", "rotor_jitter", "ee_error_last_mean_continuous"],
        "windows": windows,
        "controllers": ["paper_ct"],
        "episodes": 8,
        "precision": "bit_exact",
    }
    rows, study = flown(tmp_path, **fields)["paper_ct"], small_study(**fields)
    assert list(rows)[2:4] == list(study.paths)
    assert list(rows)[4:-2] == list(study.metrics)
    for episode in (0, 5):
        log = single(study, "paper_ct", rows, episode)
        wanted = {
            f"gust_{k}": v
            for k, v in gust(log, Errors.held(log), Window(0.1, 0.9)).items()
        }
        wanted |= calmness(log, Errors.held(log), STEADY)
        wanted["ee_error_last_mean_continuous"] = last(
            log, Errors.continuous(log), 0.4
        )["ee_error_last_mean"]
        for name in set(study.metrics) & set(wanted):
            assert rows[name][episode] == pytest.approx(wanted[name], rel=1e-12), name
