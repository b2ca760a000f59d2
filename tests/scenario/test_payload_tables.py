"""[[payloads]] of a scenario file: what it may say, and one line for what it may
not.
"""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

import skyarm
from skyarm.scenario.document import Document
from skyarm.scenario.in_flight import stretches
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.payload_tables import model_changes, scheduled_changes
from skyarm.scenario.scenario_file import TwoLoadsWarning, scenario_from
from skyarm.scenario.unlikely_numbers import load_warnings
from skyarm.simulate.batch import Batch
from skyarm.world import HangingPayload


def payloads_of(tables):
    """Payloads of a file without a task."""
    plant, base = (
        {"vehicle": "hummingbird_arm2"},
        {
            "kind": "hover",
            "position": [0.0, 0.0, 1.0],
        },
    )
    rest = {"plant": plant, "reference": {"base": base}, "duration": 1.0}
    return Document({"payloads": tables, **rest}, Path(), {}).word("payloads")


def test_belief_is_told_the_mass_that_is_held_at_each_frame():
    tables = [
        {"mass": 0.3, "pick": 1.0, "drop": 3.0, "believed": True},
        {"mass": 0.1, "pick": 2.0, "believed": True},
        {"mass": 0.2, "pick": 1.0, "frame": "hook", "believed": True},
        {"mass": 0.7, "pick": 1.0},
    ]
    found = model_changes(payloads_of(tables)[:3], 2000, 200)
    told = [(each.at, each.path, each.value) for each in found]
    tip, hook = "model.payload.mass", "model.payload.hook.mass"
    assert len(model_changes(payloads_of(tables)[:3], 500, 200)) == 3, (
        "changes after the end are left out"
    )
    assert told == [
        (1.0, tip, 0.3),
        (1.0, hook, 0.2),
        (2.0, tip, pytest.approx(0.4)),
        (3.0, tip, 0.1),
    ]


def with_parcel(**numbers):
    """Scenario of 1 s whose model has a payload at the tip."""
    parcel = {
        "name": "parcel",
        "mass": 0.1,
        "pick": 0.2,
        "drop": 0.6,
        "believed": True,
    } | numbers
    document = {
        "name": "x",
        "duration": 1.0,
        "plant": {"vehicle": "hummingbird_arm2_rotors"},
        "controller": {"preset": "centroidal_tip"},
        "payloads": [parcel],
        "reference": {"base": {"kind": "hover", "position": [0.0, 0.0, 1.0]}},
    }
    return scenario_from(document)


def test_the_model_has_a_payload_of_replaced_numbers():
    changed = with_numbers(
        with_parcel(), {"payloads.parcel.mass": 0.2, "payloads.parcel.pick": 0.3}
    )
    twin = with_parcel(mass=0.2, pick=0.3)
    for one in (changed, twin):
        begun = one.agent.model.vehicle.mass
        held = [
            (each.start, each.overrides.of(one).agent.model.vehicle.mass - begun)
            for each in stretches(one)
        ]
        assert held == [(0, 0.0), (60, pytest.approx(0.2)), (120, 0.0)]
        assert not one.changes
    assert scheduled_changes(changed) == scheduled_changes(twin)
    later = dataclasses.replace(twin, duration=0.5)
    assert [each.at for each in scheduled_changes(later)] == [0.3], (
        "changes after the end are left out"
    )


def test_a_batch_varies_the_mass_of_a_payload_in_the_model():
    begun = dataclasses.replace(with_parcel(pick=0.05, drop=0.1), duration=0.15)
    masses = np.array([0.05, 0.2])
    batch = Batch(begun, ["payloads.parcel.mass"], bit_exact=True, log_every=1)
    found = batch.fly({"payloads.parcel.mass": masses}).agents["main"].log
    for lane, mass in enumerate(masses):
        twin = with_parcel(mass=float(mass), pick=0.05, drop=0.1)
        alone = skyarm.run(dataclasses.replace(twin, duration=0.15))
        np.testing.assert_array_equal(
            found.state.position.z[lane], alone.position[:, 2]
        )
    with pytest.raises(
        skyarm.ScenarioError,
        match=r"^path = 'payloads\.parcel\.pick': must not vary in a batch, whose",
    ):
        Batch(begun, ["payloads.parcel.pick"])


def test_kinds_have_their_own_numbers():
    (payload,) = payloads_of(
        [{"kind": "hanging", "mass": 0.1, "pick": 1.0, "cord": 1.5}]
    )
    assert isinstance(payload, HangingPayload)
    assert (payload.cord, payload.drop) == (1.5, math.inf)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"pick": 1}, r"payloads\.0\.mass: "),
        ({"mass": -1, "pick": 1}, r"payloads\.0\.mass = -1"),
        ({"mass": 0.1}, r"payloads\.0\.pick"),
        (
            {"mass": 0.1, "pick": "now"},
            r"payloads\.0\.pick = 'now': must be a finite number",
        ),
        (
            {"mass": 0.1, "pick": 5, "drop": 5},
            r"payloads\.0\.drop = 5\.0: must be after pick = 5\.0 s",
        ),
        (
            {"mass": 0.1, "pick": {"within": 0, "of": [0, 0, 0]}},
            r"payloads\.0\.pick\.within = 0",
        ),
        (
            {"mass": 0.1, "pick": {"within": 0.1, "of": [0, 0]}},
            r"payloads\.0\.pick\.of",
        ),
        (
            {"mass": 0.1, "pick": {"within": 0.1, "of": [0, 0, 0], "at": 1}},
            r"payloads\.0\.pick\.at = 1: unknown field",
        ),
        (
            {"mass": 0.1, "pick": 1, "inertia": [1, 1, 3]},
            r"payloads\.0\.inertia = \[1\.0, 1\.0, 3\.0\]: no moment may",
        ),
        ({"mass": 0.1, "pick": 1, "cord": 1}, r"payloads\.0\.cord = 1: unknown field"),
        (
            {"mass": 0.1, "pick": 1, "kind": "hanging", "com": [0, 0, 0.1]},
            r"payloads\.0\.com = .*: must be left out of a hanging",
        ),
        (
            {"mass": 0.1, "pick": 1, "kind": "glued"},
            r"payloads\.0\.kind = 'glued': must be one of rigid, hanging",
        ),
        (
            {"mass": 0.1, "pick": 1, "frame": "hand"},
            r"payloads\.0\.frame = 'hand': .*no frame 'hand'; there are",
        ),
        (
            {"mass": 0.1, "pick": 1, "kind": "hanging", "cord": 0.01},
            r"payloads\.0\.stretch = 0\.02: must be at least",
        ),
        (
            {"mass": 0.1, "pick": {"within": 0.1, "of": [0, 0, 0]}, "believed": True},
            r"payloads\.0\.believed = true: must be false where a place decides",
        ),
    ],
)
def test_a_wrong_payload_is_one_line(table, words):
    document = {
        "name": "x",
        "duration": 8.0,
        "plant": {"vehicle": "hummingbird_arm2_rotors"},
        "controller": {"preset": "centroidal_joint"},
        "payloads": [table],
    }
    with pytest.raises(
        ValueError, match="^" + words.replace(r"\.0", r"\[0\]", 1)
    ) as error:
        scenario_from(document, "test")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        (
            {"kind": "disturbance", "frame": "hand"},
            r"environment\.forces\.0\.frame = 'hand': .*there are",
        ),
        (
            {"kind": "disturbance", "axes": "body"},
            r"environment\.forces\.0\.axes = 'body': must be one of world, frame",
        ),
        (
            {"kind": "disturbance", "force": [1, 2]},
            r"environment\.forces\.0\.force = \[1, 2\]: must be a list of three",
        ),
        (
            {"kind": "disturbance", "force": [0, 0, {"kind": "sine"}]},
            r"environment\.forces\.0\.force\.z\.amplitude",
        ),
        (
            {"kind": "disturbance", "noise": {"force": [1, 1, 1]}},
            r"environment\.forces\.0\.noise\.bandwidth_hz",
        ),
        (
            {"kind": "link_drag", "area": [0.1]},
            r"environment\.forces\.0\.area: 1 numbers, must be 2",
        ),
        (
            {"kind": "ground_effect", "radius": -1},
            r"environment\.forces\.0\.radius = -1: must be above",
        ),
    ],
)
def test_a_wrong_force_is_one_line(table, words):
    document = {
        "name": "x",
        "duration": 8.0,
        "plant": {"vehicle": "hummingbird_arm2_rotors"},
        "controller": {"preset": "centroidal_joint"},
        "environment": {"forces": [table]},
    }
    with pytest.raises(
        ValueError, match="^" + words.replace(r"\.0", r"\[0\]", 1)
    ) as error:
        scenario_from(document, "test")
    assert "\n" not in str(error.value)


def test_two_payloads_of_one_name_are_one_line():
    document = {
        "name": "x",
        "duration": 8.0,
        "plant": {"vehicle": "hummingbird_arm2_rotors"},
        "controller": {"preset": "centroidal_joint"},
        "payloads": [
            {"mass": 0.1, "pick": 1, "name": "a"},
            {"mass": 0.2, "pick": 2, "name": "a"},
        ],
    }
    with pytest.raises(
        ValueError, match=r"^payloads\[0\]\.name = 'a': must be of one payload only$"
    ):
        scenario_from(document, "test")


@pytest.mark.parametrize(
    ("root", "frame"), [("plant", {}), ("plant", {"frame": "tip"}), ("model", {})]
)
def test_a_load_that_comes_in_flight_beside_a_stated_one_is_said(root, frame):
    vehicle, path = {"vehicle": "hummingbird_arm2_rotors"}, f"{root}.payload.mass"
    document = {
        "name": "x",
        "duration": 1.0,
        "plant": vehicle,
        "model": vehicle,
        "controller": {"preset": "centroidal_joint"},
        "reference": {"base": {"kind": "hover", "position": [0.0, 0.0, 1.0]}},
        "changes": [{"at": 0.5, "path": path, "value": 0.1}],
    }
    alone = scenario_from(document)  # and no warning
    heavy = {root: vehicle | {"payload": {"mass": 0.3, **frame}}}
    with pytest.warns(
        TwoLoadsWarning,
        match=rf"^{path}: is a load beside {root}\.payload\.mass = 0\.3, which it",
    ):
        both = scenario_from(document | heavy)
    for scenario, held in ((alone, 0.1), (both, 0.4)):
        agent = stretches(scenario)[1].overrides.of(scenario).agent
        carrier = agent.vehicle if root == "plant" else agent.model.vehicle
        assert carrier.mass - skyarm.load_vehicle(
            "hummingbird_arm2_rotors"
        ).mass == pytest.approx(held)


@pytest.mark.parametrize(("cord", "low"), [(0.1, False), (5.0, True)])
def test_a_cord_that_is_longer_than_the_way_down_is_told(cord, low):
    """A metre above the ground."""
    document = {
        "schema": 1,
        "name": "hangs",
        "duration": 1.0,
        "plant": {"vehicle": "hummingbird_arm2_rotors"},
        "controller": {"preset": "centroidal_joint"},
        "reference": {"base": {"kind": "hover", "position": [0.0, 0.0, 1.0]}},
        "payloads": [{"kind": "hanging", "mass": 0.1, "pick": 0.5, "cord": cord}],
    }
    lines = [*load_warnings(scenario_from(document))]
    assert [line.startswith("payloads[0].cord: lets") for line in lines] == [True] * low
