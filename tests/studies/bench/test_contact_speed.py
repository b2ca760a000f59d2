"""Scenes of the benchmark of contact: they touch where they say so, on our plant."""

from __future__ import annotations

import contact_speed as room
import measure_shapes
import numpy as np
import pytest

import skyarm
from skyarm.compile.llvm import kernel
from skyarm.compile.tracing.lower import arrange


@pytest.fixture(autouse=True)
def _quick(tmp_path, monkeypatch):
    compiled = kernel._make_engine
    monkeypatch.setenv("SKYARM_CACHE", str(tmp_path))
    monkeypatch.setattr(
        "skyarm.compile.llvm.kernel._make_engine",
        lambda text, effort: compiled(text, 0),
    )


def test_the_vehicle_stands_on_its_four_skids_all_the_time():
    scenario = room.standing(0.5)
    log = skyarm.run(scenario)
    weight = float(scenario.plant.vehicle.mass) * float(scenario.plant.gravity)
    assert log.status == "completed"
    assert (log.contact_force.sum(axis=1) > 0.0).all()
    assert log.contact_force.shape[1] == len(room.SKIDS)
    assert log.contact_force[0].sum() == pytest.approx(weight, rel=0.01)


@pytest.mark.thorough
def test_the_tip_presses_where_mujoco_begins_to_be_timed():
    log = skyarm.run(room.pressing(room.TOUCHED + 0.5))
    assert (log.contact_force[log.time > room.TOUCHED, 0] > 0.2).all()


def always_computed(scenario):
    """Number of operations of a period outside loops and calls that are skipped."""
    nodes = measure_shapes.flight_of(scenario).loop.program.nodes
    quiet = ("input", "const", "item", "result")
    return sum(node.op not in quiet for node, _ in arrange(nodes))


def test_shapes_near_nothing_are_computed_in_parts_that_are_skipped(tmp_path):
    bare, dressed = (
        always_computed(measure_shapes.scene(tmp_path, 1, shapes=each, near=False))
        for each in (False, True)
    )
    assert dressed < 1.03 * bare


def test_shapes_are_near_the_floor_a_tenth_of_the_time(tmp_path):
    scenario = measure_shapes.scene(tmp_path, 0, shapes=True, near=True)
    height = skyarm.run(scenario).position[:, 2]
    assert 0.08 < (height < 0.34).mean() < 0.14
    assert height.min() > 0.29


def test_bare_mujoco_stands_on_the_same_skids_for_as_long_as_it_says():
    rollout, one = room.bare_mujoco(room.standing(0.1), 1.25e-3, 2, 20)
    assert one.run() == pytest.approx(20 * 1.25e-3)
    assert rollout.run() == pytest.approx(2 * 8 * 20 * 1.25e-3)
    assert "1.25 ms" in one.what


@pytest.mark.thorough
def test_contenders_fly_what_they_say():
    names, seconds = [], []
    for each in room.standing_contenders(0.05, 1, 1):
        names.append(each.name)
        seconds.append(each.run())
    assert names[:2] == ["mujoco.rollout", "mj_step"]
    assert names[2:] == [
        "contact f64, 1 threads",
        "contact f32, 1 threads",
        "free f64, 1 threads",
        "free f32, 1 threads",
    ]
    assert np.all(np.array(seconds[2:]) > 0.0)
