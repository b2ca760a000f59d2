"""Columns of a log that a user's component declares: in every file, by its own names and units."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np

import skyarm
from skyarm.algebra import Vec3
from skyarm.log.log_columns import columns
from skyarm.view.figures.flight_panels import panels_of
from skyarm.world import Wrench


@dataclasses.dataclass(frozen=True)
class Cable(skyarm.Force):
    """A force whose tension is logged in an array of its own."""

    tension: float = 0.1
    columns: ClassVar = (("cable_tension", "near end", "N"), ("cable_tension", "far end", "N"))

    def wrenches(self, memory, t, motion, rotor_speeds):
        return (Wrench(force_W=Vec3(0.0, 0.0, -self.tension)),)

    def logged(self, memory, motion):
        return (self.tension, 2.0 * self.tension)


def test_a_component_logs_what_it_declares(tmp_path):
    scenario = skyarm.load_scenario("case1", duration=0.1).with_words(forces=(Cable(),))
    log = skyarm.run(scenario)
    assert np.array_equal(log["components.cable_tension"], np.tile([0.1, 0.2], (log.time.size, 1)))
    found = {each.name: each.unit for each in columns(log) if "cable" in each.name}
    assert found == {
        "cable_tension_near_end": "N",
        "cable_tension_far_end": "N",
    }
    assert log.readings == {}
    log.save_npz(tmp_path / "log.npz")
    read = skyarm.Log.load_npz(tmp_path / "log.npz")
    assert np.array_equal(read["components.cable_tension"], log["components.cable_tension"])


def test_they_have_panels():
    scenario = skyarm.load_scenario("case1", duration=0.1).with_words(forces=(Cable(),))
    log = skyarm.run(scenario)
    near, far = panels_of("parts", [log])
    assert (near.label, near.unit) == ("cable_tension_near_end", "N")
    assert np.array_equal(far.of(log), np.full(log.time.size, 0.2))
