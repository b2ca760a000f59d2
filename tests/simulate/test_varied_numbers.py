"""Every kind of number of a scenario file may differ from lane to lane; each lane is
the flight of its file.
"""

from __future__ import annotations

import copy
import dataclasses

import numpy as np
import pytest

from skyarm.algebra import Quaternion
from skyarm.log.metrics.windows import Windows
from skyarm.records.plain import digest, plain
from skyarm.scenario.numbers import number_at, require_apart, with_numbers
from skyarm.scenario.scenario_file import scenario_from
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.simulate import Window, run
from skyarm.simulate.batch import Batch
from skyarm.simulate.first_state import first_loop_state
from support.cases import sampled
from support.flights import document

TEXT = document(
    "everything",
    plant={
        "vehicle": "hummingbird_arm2_rotors",
        "gravity": 9.8,
        "joints": {
            "damping": 0.0005,
            "coulomb": 1e-5,
            "coulomb_rate": 0.05,
            "effort_limit": 0.4,
        },
    },
    model={"vehicle": "hummingbird_arm2", "gravity": 9.81},
    duration=0.25,
    reference={
        "base": [
            {
                "kind": "circle",
                "radius": 0.3,
                "frequency_hz": 0.6,
                "center": [0.0, 0.1, 1.0],
                "start": 0.1,
                "stop": 2.0,
            },
            {"kind": "hover", "position": [0.01, 0.0, 0.02]},
            {
                "kind": "signals",
                "z": {"kind": "ramp", "start": 0.05, "duration": 0.2, "height": 0.1},
            },
        ],
        "yaw": {
            "kind": "ramp",
            "start": 0.02,
            "duration": 0.05,
            "height": 0.1,
            "shape": "quintic",
        },
        "joints": [
            {
                "kind": "sine",
                "amplitude": 0.1,
                "frequency_hz": 1.0,
                "phase": 0.2,
                "start": 0.0,
                "stop": 2.0,
            },
            [0.05, {"kind": "constant", "value": 0.02, "start": 0.1, "stop": 0.2}],
        ],
    },
    initial={
        "quaternion_wxyz": [1.0, 0.0, 0.0, 0.0],
        "velocity": [0.1, 0.0, 0.0],
        "joints": [0.1, 0.0],
    },
)
"""Every table of a file but payloads, with turbulence, noise and delays."""

IN_FILE = {
    "plant.gravity": 9.7,
    "plant.joints.damping": 0.0007,
    "plant.joints.coulomb": 2e-5,
    "plant.joints.coulomb_rate": 0.04,
    "plant.joints.effort_limit": 0.3,
    "model.gravity": 9.9,
    "controller.gains.position.0": 4.4,
    "controller.joint_gains.damping.1": 9.0,
    "environment.wind.velocity.1": 0.2,
    "environment.wind.gust.velocity.1": 1.2,
    "environment.wind.gust.duration": 0.05,
    "sensors.attitude": 0.002,
    "reference.base.0.radius": 0.25,
    "reference.base.0.frequency_hz": 0.7,
    "reference.base.0.center.1": 0.2,
    "reference.base.0.start": 0.16,
    "reference.base.0.stop": 0.2,
    "reference.base.1.position.2": 0.05,
    "reference.base.2.z.height": 0.2,
    "reference.yaw.duration": 0.08,
    "reference.joints.0.amplitude": 0.15,
    "reference.joints.0.frequency_hz": 1.5,
    "reference.joints.0.phase": 0.3,
    "reference.joints.0.start": 0.11,
    "reference.joints.1.0": 0.07,
    "reference.joints.1.1.value": 0.04,
    "initial.velocity.0": 0.2,
}
"""Paths in the words of the file, and the number that replaces the file's."""

OTHERS = {
    "plant.vehicle.base.mass": 0.7,
    "plant.vehicle.links.link1.joint.damping": 0.0006,
    "plant.vehicle.frames.tip.position.z": -0.2,
    "plant.payload.mass": 0.02,
    "model.payload.tip.mass": 0.01,
    "reference.x.signals.1.value": 0.03,
    "environment.wind.turbulence.intensity.z": 0.6,
    "initial.quaternion_wxyz.1": 0.1,
    "initial.position.x": 0.05,
    "initial.joints.0": 0.15,
    "initial.rotor_speeds.0": 450.0,
}
"""Paths through the records, and numbers that something is derived from."""


@pytest.fixture(scope="module")
def scenario():
    return scenario_from(TEXT, "test")


def rewritten(path, value, text=TEXT):
    """The file with the number of a path replaced."""
    made = copy.deepcopy(text)
    *tables, last = path.split(".")
    at = made
    for word in tables:
        at = at[int(word)] if isinstance(at, list) else at[word]
    at[int(last) if isinstance(at, list) else last] = value
    return made


def fingerprint(scenario, start=None):
    """Digest of all that would be flown, from a named state if there is one: what a
    file sets stays as it is.
    """
    return digest(
        plain(
            dataclasses.replace(
                scenario, name="same", initial=start or scenario.initial
            )
        )
    )


@pytest.mark.parametrize("path", IN_FILE)
def test_a_path_in_the_words_of_the_file_is_the_file_with_that_number_replaced(
    scenario, path
):
    # what is derived from the wind when a file is read stays, so that a path changes
    # one number
    text = copy.deepcopy(TEXT)
    if path.startswith("environment.wind.velocity"):
        del text["environment"]["wind"]["turbulence"]
        scenario = scenario_from(text, "test")
    value = IN_FILE[path]
    assert number_at(scenario, path) != value
    start = None if path.startswith("initial.") else scenario.initial
    loaded = scenario_from(rewritten(path, value, text), "test")
    assert fingerprint(with_numbers(scenario, {path: value})) == fingerprint(
        loaded, start
    )


@pytest.mark.parametrize("where", ["plant", "model"])
def test_a_payload_by_its_path_is_the_payload_of_a_file(scenario, where):
    loaded = scenario_from(rewritten(f"{where}.payload", {"mass": 0.03}), "test")
    changed = with_numbers(scenario, {f"{where}.payload.mass": 0.03})
    assert fingerprint(changed) == fingerprint(
        with_numbers(scenario, {f"{where}.payload.tip.mass": 0.03})
    )
    assert fingerprint(changed) == fingerprint(loaded, scenario.initial)
    assert fingerprint(changed) != fingerprint(scenario)


def flown(log, k):
    """What moved in lane k of a batch's log."""
    state, command = log.state, log.command
    columns = (
        *state.position,
        *state.quaternion,
        *state.joints,
        *command.rotor_speeds,
        *command.efforts,
    )
    return np.stack([c[k] for c in columns], axis=1).tobytes()


def apart(scenario, names):
    """Names in groups in which no number has two names."""
    groups: list[list[str]] = []
    for name in names:
        for group in groups:
            try:
                require_apart(scenario, (*group, name))
            except ScenarioError:
                continue
            group.append(name)
            break
        else:
            groups.append([name])
    return groups


@pytest.mark.parametrize("group", sampled([0, 1, 2], 2))
def test_each_lane_is_the_single_flight_of_its_numbers_bit_for_bit(scenario, group):
    """Lane k changes the k-th number only; four more change a quarter of them each, and
    are flown alone, too.
    """
    every = IN_FILE | OTHERS
    groups = [*apart(scenario, every), list(OTHERS)[:2]]
    assert len(groups) == 3
    own_motion = group < 2
    replaced = {path: every[path] for path in groups[group]}
    paths = tuple(replaced)
    batch = Batch(
        scenario, paths, bit_exact=True, log_every=1, metrics=("iae_position",)
    )
    alone = 4 if own_motion else 1
    values = {
        p: np.full(len(paths) + 1 + alone, base)
        for p, base in zip(paths, batch.base, strict=True)
    }
    for k, path in enumerate(paths):
        values[path][[k, len(paths) + 1 + k % alone]] = replaced[path]
    keys = np.zeros(len(paths) + 1 + alone, dtype=int)
    found = batch.fly(values, seed=scenario.seed, episodes=keys).log
    for k in range(len(paths) + 1, len(keys)):
        numbers = {p: float(v[k]) for p, v in values.items()}
        log = run(dataclasses.replace(with_numbers(scenario, numbers), episode=0))
        assert log.time.size == scenario.steps
        single = (
            log.position,
            log.quaternion,
            log.joints,
            log.rotor_commands,
            log.efforts,
        )
        assert flown(found, k) == np.concatenate(single, axis=1).tobytes(), k
    # every number moves something, but for the place of the tool's frame, which is
    # measured only, and a torque limit that is not reached
    same = {
        path
        for k, path in enumerate(paths)
        if flown(found, k) == flown(found, len(paths))
    }
    assert same <= {"plant.vehicle.frames.tip.position.z", "plant.joints.effort_limit"}


def test_the_tool_of_each_lane_is_measured_where_its_own_frame_is():
    """The frame's place is no part of the motion: error of the tool against the log's,
    1e-12 as sums of 60 numbers.
    """
    scenario = scenario_from(
        {**TEXT, "delays": {}, "sensors": {}, "duration": 0.2}, "test"
    )
    path = "plant.vehicle.frames.tip.position.z"
    windows = Windows(steady=Window(0.1, 0.2))
    names = ("ee_error_mean", "ee_error_mean_continuous")
    for paths in ((path,), (path, "reference.base.0.radius")):
        batch = Batch(scenario, paths, bit_exact=True, windows=windows, metrics=names)
        values = {
            path: np.array([-0.1, -0.3]),
            "reference.base.0.radius": np.array([0.3, 0.5]),
        }
        values = {p: values[p] for p in paths}
        outcome = batch.fly(values, seed=scenario.seed, episodes=np.array([1, 1]))
        for k in range(2):
            log = run(
                with_numbers(scenario, {p: float(v[k]) for p, v in values.items()})
            )
            at = log.time >= 0.1
            for name, goal in zip(
                names, (log.tool_held, log.tool_reference), strict=True
            ):
                wanted = np.linalg.norm(log.tool - goal, axis=1)[at].mean()
                assert outcome.metrics[name][k] == pytest.approx(wanted, rel=1e-12)


def test_angles_turn_the_first_attitude_as_scipy_turns_it(scenario):
    Rotation = pytest.importorskip("scipy.spatial.transform").Rotation
    angles = {"initial.roll": 0.3, "initial.pitch": -0.4, "initial.yaw": 1.1}
    quaternion = with_numbers(scenario, angles).initial.quaternion
    x, y, z, w = Rotation.from_euler("ZYX", [1.1, -0.4, 0.3]).as_quat()
    assert tuple(quaternion) == pytest.approx((w, x, y, z), abs=1e-15)
    for path, value in angles.items():
        assert number_at(with_numbers(scenario, angles), path) == pytest.approx(
            value, abs=1e-15
        )


def test_a_component_of_the_quaternion_leaves_it_at_unit_length(scenario):
    q = with_numbers(scenario, {"initial.quaternion_wxyz.2": 1.0}).initial.quaternion
    assert tuple(q) == pytest.approx((np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0), abs=1e-15)
    assert isinstance(q, Quaternion)


def test_a_start_without_a_state_follows_the_lane_s_own_trim():
    """Hover trim of the heavier truth, only the named number replaced."""
    scenario = scenario_from(document("case1", duration=0.1), "test")
    assert scenario.initial is None
    numbers = {"plant.vehicle.base.mass": 0.9, "initial.position.x": 0.1}
    varied = with_numbers(scenario, numbers)
    file = document("case1", duration=0.1, initial={"position": [0.1, 0.0, 1.0]})
    heavier = scenario_from(file, "test")
    assert varied.initial.position.x == 0.1
    # reading solves no trim: the loop's first state has it
    speeds, usual = (
        first_loop_state(each).agents[0].state.rotor_speeds
        for each in (varied, heavier)
    )
    assert speeds[0] > usual[0] > 0.0
    # with the truth's own mass it is the file's start
    assert (
        with_numbers(scenario, {"initial.position.x": 0.1}).initial == heavier.initial
    )
    joints = scenario_from(
        document("case1", duration=0.1, initial={"joints": [0.0, 0.7]}), "test"
    )
    assert with_numbers(scenario, {"initial.joints.1": 0.7}).initial == joints.initial


STRUCTURE = [
    "duration",
    "rates.control",
    "delays.measurement",
    "seed",
    "episode",
    "environment.ground",
]


@pytest.mark.parametrize("path", STRUCTURE)
def test_what_shapes_an_episode_is_refused_as_structure(scenario, path):
    with pytest.raises(
        ScenarioError, match="is structure, the same for all episodes; fly two studies"
    ):
        number_at(scenario, path)


REFUSED = {
    "reference.base.0.width": (
        r"no 'width' here; there are x, y, z, radius, frequency_hz, center, start, stop"
    ),
    "reference.base.3.radius": r"no '3' here; there are 0, 1, 2",
    "reference.base.0": r"must lead to a number; there are x, y, z, radius",
    "reference.joints.0.height": (
        r"no 'height' here; there are amplitude, frequency_hz, phase"
    ),
    "plant.payload.hand.mass": r"no 'hand' here; there are mass, tip$",
    "plant.joints.mass": (
        r"no 'mass' here; there are damping, coulomb, coulomb_rate, effort_limit"
    ),
    "environment.wind.turbulence.gusts": r"no 'gusts' here; there are intensity",
    "initial.heading": r"no 'heading' here; there are position, quaternion",
}


@pytest.mark.parametrize("path", REFUSED)
def test_a_path_that_leads_nowhere_lists_what_there_is(scenario, path):
    with pytest.raises(ScenarioError, match=REFUSED[path]):
        number_at(scenario, path)


def test_a_log_keeps_every_kth_instant_and_nothing_of_the_dead():
    """The second lane falls to the ground: what it left is NaN from there on."""
    scenario = scenario_from(document("case2", duration=1.0), "test")
    mass = "plant.vehicle.base.mass"
    batch = Batch(scenario, (mass,), bit_exact=True, log_every=7)
    outcome = batch.fly({mass: np.array([0.73, 9.0])})
    log, alone = (
        outcome.log,
        [run(with_numbers(scenario, {mass: m})) for m in (0.73, 9.0)],
    )
    assert log.time.tolist() == alone[0].time[::7].tolist()
    for k, single in enumerate(alone):
        count = len(single.time[::7])
        assert log.alive[k].tolist() == [i < count for i in range(len(log.time))]
        assert (
            log.state.velocity.z[k, :count].tolist() == single.velocity[::7, 2].tolist()
        )
        assert (
            log.command.efforts[1][k, :count].tolist()
            == single.efforts[::7, 1].tolist()
        )
        assert (
            log.reference.position.z[k, :count].tolist()
            == single.position_held[::7, 2].tolist()
        )
        assert np.isnan(log.state.velocity.z[k, count:]).all()
    assert outcome.status.tolist() == ["completed", "ground"]
    assert (
        Batch(scenario, (mass,), bit_exact=True).fly({mass: np.array([0.73])}).log
        is None
    )
