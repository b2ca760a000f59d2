"""Changes by hand and by a file beside those that follow from payloads and from gains
inside a safety layer.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.scenario.scenario_file import scenario_from
from skyarm.simulate.batch import Batch
from skyarm.simulate.lane_numbers import MeasuredLimitsWarning

GUARDED = {"preset": "paper_ct", "safety": {}}
GAIN = {"at": 0.1, "path": "controller.inner.gains.position.z", "value": 3.0}
BOX = {"name": "box", "mass": 0.03, "pick": 0.2, "drop": 0.4, "believed": True}


def hover(**tables: Any) -> skyarm.Scenario:
    return scenario_from(
        {
            "name": "hover",
            "duration": 0.5,
            "plant": {"vehicle": "hummingbird_arm2_rotors"},
            "model": {"vehicle": "hummingbird_arm2"},
            "reference": {"base": {"kind": "signals", "x": 0, "y": 0, "z": 1.0}},
            "controller": {"preset": "paper_ct"},
            **tables,
        }
    )


def test_the_plan_of_a_flight_keeps_a_change_by_hand_at_the_instant_of_a_pick():
    session = skyarm.Session(hover(payloads=[BOX]))
    while session.tick < 40:
        session.step()
    session.change({"model.payload.mass": 0.3})
    while session.tick < 100:
        session.step()
    again = skyarm.run(session.plan)
    np.testing.assert_array_equal(again.position, session.log.position)
    assert (
        np.abs(again.position - skyarm.run(hover(payloads=[BOX])).position).max() > 1e-3
    )


def test_a_batch_of_payload_masses_flies_changes_of_gains_inside_a_safety_layer():
    scenario = hover(payloads=[BOX], controller=GUARDED, changes=[GAIN])
    done = Batch(scenario, ["payloads.0.mass"], effort=0).fly(
        {"payloads.0.mass": np.array([0.03, 0.05])}
    )
    assert (done.status == "completed").all()


def test_a_varied_change_of_a_gain_warns_as_the_gain_does():
    with pytest.warns(MeasuredLimitsWarning, match=r"changes\.0\.value"):
        Batch(hover(controller=GUARDED, changes=[GAIN]), ["changes.0.value"], effort=0)
