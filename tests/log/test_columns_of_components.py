"""Columns of a log that a user's component declares: in every file, by its own names
and units.
"""

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
    """A force whose tension is logged in an array of its own, and its state in one of
    two units.
    """

    tension: float = 0.1
    columns: ClassVar = (
        ("cable_tension", "near end", "N"),
        ("cable_tension", "far end", "N"),
        ("cable", "length", "m", "drawn"),
        ("cable", "rate", "m/s", "drawn"),
    )

    def wrenches(self, memory, t, motion, rotor_speeds):
        return (Wrench(force_W=Vec3(0.0, 0.0, -self.tension)),)

    def logged(self, memory, motion):
        return (self.tension, 2.0 * self.tension, 1.0, 0.0)


def test_a_component_logs_what_it_declares(tmp_path):
    scenario = dataclasses.replace(
        skyarm.load_scenario("case1", duration=0.1), forces=(Cable(),)
    )
    log = skyarm.run(scenario)
    assert np.array_equal(
        log["components.cable_tension"], np.tile([0.1, 0.2], (log.time.size, 1))
    )
    found = {each.name: each.unit for each in columns(log) if "cable" in each.name}
    assert found == {
        "cable_tension_near_end": "N",
        "cable_tension_far_end": "N",
        "cable_length": "m",
        "cable_rate": "m/s",
    }
    assert log.readings == {}
    log.save_npz(tmp_path / "log.npz")
    read = skyarm.Log.load_npz(tmp_path / "log.npz")
    assert np.array_equal(
        read["components.cable_tension"], log["components.cable_tension"]
    )
    # by the name of an array, as an attribute and in files, and by that of a column
    units = {
        "components.cable_tension": "N",
        "cable_tension": "N",
        "components.cable": "m or m/s, drawn",
        "cable": "m or m/s, drawn",
        "cable_tension_near_end": "N",
        "cable_tension_far_end": "N",
        "cable_length": "m, drawn",
        "cable_rate": "m/s, drawn",
    }
    for each in (log, read):
        assert {
            name: unit.words for name, unit in each.units.items() if "cable" in name
        } == units
        assert set(each.units) == set(each.arrays()) | set(units)


def test_they_have_panels():
    scenario = dataclasses.replace(
        skyarm.load_scenario("case1", duration=0.1), forces=(Cable(),)
    )
    log = skyarm.run(scenario)
    near, far, *_ = panels_of("parts", [log])
    assert (near.label, near.unit) == ("cable_tension_near_end", "N")
    assert np.array_equal(far.of(log), np.full(log.time.size, 0.2))
