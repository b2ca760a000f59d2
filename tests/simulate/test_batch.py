"""A batch of episodes against single ones: every lane is the flight its own numbers
give, whoever flies beside it.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.tracing.lower import operations
from skyarm.log.metrics.windows import Windows
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_file import load_scenario, scenario_from
from skyarm.simulate import Window, batch_leg, run
from skyarm.simulate.batch import Batch
from support.flights import document


@pytest.fixture(autouse=True, scope="module")
def _optimised():
    """Code as users fly it; other tests hurry the compiler."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SKYARM_EFFORT", "2")
        yield


NOISE = {
    "position": 0.003,
    "velocity": 0.02,
    "attitude": 0.004,
    "rate": 0.03,
    "joint_rates": 0.02,
    "rotor_speeds": 1.0,
}
MASS, GAIN, DAMPING = (
    "plant.vehicle.base.mass",
    "controller.gains.position.x",
    "plant.vehicle.links.link1.joint.damping",
)
PATHS = (MASS, GAIN, DAMPING)
WINDOWS = Windows(steady=Window(0.5, 1.0), transient=Window(0.0, 0.5))


@pytest.fixture(scope="module")
def scenario():
    return scenario_from(
        document("case2_gust", duration=1.0, sensors=NOISE, seed=5), "test"
    )


@pytest.fixture(scope="module")
def exact(scenario):
    return Batch(scenario, PATHS, windows=WINDOWS, bit_exact=True)


def numbers(batch, lanes, salt=0):
    rng = np.random.default_rng([3, salt])
    factors = rng.uniform([0.97, 0.8, 0.5], [1.03, 1.2, 1.5], (lanes, 3))
    return {
        path: base * column
        for path, base, column in zip(batch.paths, batch.base, factors.T, strict=True)
    }


def flat(outcome):
    """Everything an outcome holds, one column per lane."""
    state = outcome.state
    parts = [*state.position, *state.quaternion, *state.velocity, *state.rate]
    parts += [*state.joints, *state.joint_rates, *state.rotor_speeds]
    return np.stack([*parts, outcome.end_time, *outcome.metrics.values()])


def test_without_a_seed_the_noise_is_the_scenarios(exact):
    values = numbers(exact, 3)
    own, other = flat(exact.fly(values)), flat(exact.fly(values, seed=0))
    assert own.tobytes() == flat(exact.fly(values, seed=5)).tobytes() != other.tobytes()


def test_every_lane_is_the_single_flight_of_its_numbers(scenario, exact):
    values = numbers(exact, 11)
    outcome = exact.fly(values, seed=5)
    for k in (0, 3, 10):
        alone = with_numbers(
            scenario, {path: float(column[k]) for path, column in values.items()}
        )
        log = run(dataclasses.replace(alone, episode=k))
        last = log.rotor_speeds[-1]
        # the log ends one period before the batch's last state, so the flight one
        # period longer is compared
        longer = run(
            dataclasses.replace(alone, episode=k, duration=scenario.duration + 0.005)
        )
        assert [float(c[k]) for c in outcome.state.position] == longer.position[
            -1
        ].tolist()
        assert [float(c[k]) for c in outcome.state.rotor_speeds] == longer.rotor_speeds[
            -1
        ].tolist()
        assert last.tolist() != longer.rotor_speeds[-1].tolist()


def test_results_do_not_depend_on_threads_chunks_or_width(scenario, exact, monkeypatch):
    values = numbers(exact, 21)
    whole = flat(exact.fly(values, seed=5))
    assert flat(exact.fly(values, seed=5, threads=2)).tobytes() == whole.tobytes()
    monkeypatch.setattr("skyarm.simulate.batch.host_width", lambda **_: 2)
    narrow = Batch(scenario, PATHS, windows=WINDOWS, bit_exact=True)
    assert flat(narrow.fly(values, seed=5)).tobytes() == whole.tobytes()
    for a, b in ((0, 5), (5, 6), (6, 21)):
        part = {path: column[a:b] for path, column in values.items()}
        assert (
            flat(exact.fly(part, seed=5, episodes=np.arange(a, b))).tobytes()
            == whole[:, a:b].tobytes()
        )


def test_lanes_that_diverge_say_when_and_leave_their_neighbours_their_bits(exact):
    values = numbers(exact, 20)
    healthy = flat(exact.fly(values, seed=5))
    spoiled = {path: column.copy() for path, column in values.items()}
    spoiled[MASS][6] = 1e5  # falls at once
    spoiled[GAIN][11] = 4e5  # far beyond what the rotors can follow
    # starts at its trim and falls when the model's commands arrive
    spoiled[MASS][17] *= 3.0
    outcome = exact.fly(spoiled, seed=5)
    sick = [6, 11, 17]
    well = [k for k in range(20) if k not in sick]
    assert flat(outcome)[:, well].tobytes() == healthy[:, well].tobytes()
    assert outcome.completed[well].all()
    assert not outcome.completed[sick].any()
    assert 0.0 <= outcome.end_time[6] < 1.0
    assert 0.0 < outcome.end_time[11] < 1.0
    assert 0.0 < outcome.end_time[17] < 1.0
    assert all(outcome.status[k] != "completed" for k in sick)
    # never reached the window
    assert np.isnan(outcome.metrics["position_error_mean"][6])
    assert outcome.metrics["position_error_max"][17] > 0.1  # counted while it fell


@pytest.mark.parametrize("single", [False, True])
def test_the_fast_modes_stay_near_the_exact_one(scenario, exact, single):
    """Rounding of single precision is forgotten by the feedback: metrics within 1 %
    (double: 1e-9).
    """
    values = numbers(exact, 16)
    wanted = exact.fly(values, seed=5)
    found = Batch(scenario, PATHS, windows=WINDOWS, single=single).fly(values, seed=5)
    for name, column in wanted.metrics.items():
        assert found.metrics[name] == pytest.approx(
            column, rel=1e-2 if single else 1e-9, abs=1e-6
        ), name


def test_a_mass_that_is_swept_changes_what_the_mass_changes(exact):
    """A heavier truth than the model sags: the mean height falls with the mass, lane by
    lane.
    """
    base = dict(zip(exact.paths, exact.base, strict=True))
    masses = base[MASS] * np.linspace(0.98, 1.1, 8)
    values = {path: np.full(8, value) for path, value in base.items()} | {MASS: masses}
    outcome = exact.fly(values, seed=5, episodes=np.zeros(8, dtype=int))
    assert np.all(np.diff(outcome.state.position.z) < 0.0)


def test_a_batch_without_paths_repeats_the_scenario_with_other_noise(scenario):
    batch = Batch(scenario, windows=WINDOWS, bit_exact=True)
    outcome = batch.fly({}, seed=5, episodes=np.array([0, 1, 0]))
    columns = flat(outcome)
    assert columns[:, 0].tobytes() == columns[:, 2].tobytes()
    assert columns[:, 0].tobytes() != columns[:, 1].tobytes()


def test_every_lane_flies_through_turbulence_of_its_own():
    wind = {
        "mode": "moving_air",
        "velocity": [1.0, 0.0, 0.0],
        "turbulence": {"altitude": 6.0, "wind_20ft": 7.7},
    }
    scenario = scenario_from(
        document("case2", duration=0.2, environment__wind=wind), "test"
    )
    with Batch(scenario, (MASS,), bit_exact=True) as batch:
        outcome = batch.fly({MASS: np.full(3, float(scenario.plant.vehicle.base.mass))})
    for k in range(3):
        alone = run(dataclasses.replace(scenario, episode=k, duration=0.205))
        assert [float(c[k]) for c in outcome.state.position] == alone.position[
            -1
        ].tolist()
    assert len(set(outcome.state.position.x.tolist())) == 3


@pytest.mark.parametrize("path", ["plant.vehicle.base.mass", "reference.base.x.height"])
def test_lost_is_measured_from_the_reference_of_the_end_not_from_that_of_the_start(
    path,
):
    # 200 m/s from 950 m on: over 1000 m from where the reference was, some 450 m from
    # where it is
    vehicles = {
        "plant": {"vehicle": "hummingbird_arm2_rotors"},
        "model": {"vehicle": "hummingbird_arm2"},
    }
    ramp = {"kind": "ramp", "start": 0.0, "duration": 0.5, "height": 600.0}
    scenario = scenario_from(
        {
            **{
                "name": "far",
                "duration": 0.6,
                "controller": {"preset": "paper_ct"},
                **vehicles,
            },
            "reference": {"base": {"kind": "signals", "x": ramp, "z": 50.0}},
            "initial": {"position": [950.0, 0.0, 50.0], "velocity": [200.0, 0.0, 0.0]},
        }
    )
    log = run(scenario)
    assert log.status == "completed"
    assert log.position[-1, 0] > 1000.0
    value = {"plant.vehicle.base.mass": 0.72, "reference.base.x.height": 600.0}[path]
    assert (
        Batch(scenario, (path,)).fly({path: np.array([value, value])}).status.tolist()
        == ["completed"] * 2
    )


def test_a_log_of_lanes_is_alive_to_the_end_and_has_no_estimate_without_an_estimator():
    scenario = load_scenario("case1", duration=0.05)
    log = (
        Batch(scenario, ("plant.gravity",), log_every=1)
        .fly({"plant.gravity": np.array([9.81, 9.7])})
        .log
    )
    assert log.alive.shape == (2, len(log.time))
    assert log.alive.all()
    assert log.estimate is None


MODES = {"exact": {"bit_exact": True}, "f64": {}, "f32": {"single": True}}


@pytest.mark.parametrize("mode", MODES)
def test_what_depends_on_time_alone_is_evaluated_once_a_period(mode, monkeypatch):
    """A path whose size is the lane's own, in flights of which some end early: fewer
    operations, the same bits.
    """
    scenario, radius = load_scenario("case3", duration=2.0), "reference.base.radius"
    values = {MASS: np.linspace(0.7, 3.0, 21), radius: np.linspace(0.2, 1.5, 21)}
    batches = [Batch(scenario, (MASS, radius), **MODES[mode])]
    monkeypatch.setattr(
        batch_leg,
        "Kernel",
        lambda *given, **options: Kernel(*given, **options | {"ahead": False}),
    )
    batches.append(Batch(scenario, (MASS, radius), **MODES[mode]))
    split, whole = (batch.fly(values) for batch in batches)
    assert flat(split).tobytes() == flat(whole).tobytes()
    assert 0 < np.sum(split.completed) < 21
    ended = np.round(split.end_time * scenario.rates.control)[~split.completed]
    assert len(set(ended)) > 1, "each keeps the tick at which it ended"
    sizes = [
        operations(batch._legs[0].code.kernel.loop.program.nodes) for batch in batches
    ]
    assert sizes[0] < 0.92 * sizes[1]
