"""Dry friction of torque-driven joints, of which no file tells: looked for, and found
behind encoders.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from planted_vehicles import NOMINAL, fly_designed, weighed

import skyarm
from skyarm.identify.identify_windows import identify_by_windows
from skyarm.identify.unknowns import unknowns_of


def test_friction_that_is_not_on_record_is_looked_for():
    words = {
        "curve": False,
        "velocity": False,
        "voltage": False,
        "driven": (True, True),
    }
    found = {each.name: each for each in unknowns_of(NOMINAL, **words)}
    body = NOMINAL.links[1].body
    dry = found["links.link2.joint.coulomb"]
    assert (dry.start, dry.positive) == (0.0, False)
    # a tenth of the link's weight at its centre of mass
    assert dry.spread == pytest.approx(0.1 * 9.81 * body.mass * abs(body.com.z))
    assert "links.link2.joint.coulomb_rate" not in found
    six = {
        each.name: each
        for each in unknowns_of(
            skyarm.load_vehicle("hexarotor_arm6"), **words | {"driven": [True] * 6}
        )
    }
    record = skyarm.load_vehicle("hexarotor_arm6").links[0]
    assert six[f"links.{record.name}.joint.coulomb"].positive
    assert six[f"links.{record.name}.joint.coulomb_rate"].start == pytest.approx(0.5)


def planted_friction(seed, bend):
    """Numbers of friction of a planted vehicle behind 12 bits a turn, and what a
    designed flight shows of them.
    """
    draw = np.random.default_rng([seed, 3])
    more = {
        f"links.{link.name}.joint.coulomb": 0.005 * draw.uniform(0.5, 1.5)
        for link in NOMINAL.links
    }
    more |= {f"links.{link.name}.joint.coulomb_rate": bend for link in NOMINAL.links}
    numbers, vehicle, flight = fly_designed(seed, more=more)
    start = weighed(vehicle)
    joints = (
        dataclasses.replace(link.joint, coulomb_rate=bend) for link in start.links
    )
    links = tuple(
        dataclasses.replace(link, joint=joint)
        for link, joint in zip(start.links, joints, strict=True)
    )
    start = dataclasses.replace(start, links=links)
    found = identify_by_windows([flight], start)
    names = [name for name in numbers if name.endswith(("coulomb", "damping"))]
    return [(numbers[name], found[name]) for name in names]


@pytest.mark.thorough
def test_planted_friction_is_found_behind_encoders():
    """Without any on record: medians of 3 % of it and of the damping, none is 5 % off;
    85 % of 40 intervals cover.
    """
    pytest.importorskip("scipy", reason="needs the extra 'identify'")
    pairs = [pair for seed in range(10) for pair in planted_friction(seed, 0.1)]
    assert all(found.is_known for _, found in pairs)
    errors = [abs(found.value / truth - 1.0) for truth, found in pairs]
    assert np.median(errors) <= 0.03
    assert max(errors) <= 0.05
    assert np.mean([found.low <= truth <= found.high for truth, found in pairs]) >= 0.85


@pytest.mark.thorough
def test_friction_that_bends_within_a_tick_needs_finer_steps():
    """Of 0.01 rad/s, where the encoder shows 0.3 rad/s from one sample to the next; at
    one step 7 % off.
    """
    pytest.importorskip("scipy", reason="needs the extra 'identify'")
    for truth, found in planted_friction(0, 0.01):
        assert found.is_known
        assert found.value == pytest.approx(truth, rel=0.003)
        assert found.low <= truth <= found.high
