"""Grasps of a log: from taking hold to letting go, to the next object, or to the end of
the log.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from skyarm.log.periods import grasp_periods


def log_of(taken, lost=None, force=None):
    taken = np.array(taken, dtype=float).T.reshape(
        -1, np.ndim(taken) if np.ndim(taken) == 1 else len(taken)
    )
    zeros = np.zeros_like(taken)
    labels = {
        "gripper_taken": ["g", "h"],
        "object_position": [
            f"{name}/{axis}" for name in ("box", "peg") for axis in "xyz"
        ],
    }
    arrays = {
        "gripper_taken": taken,
        "gripper_lost": zeros if lost is None else np.array(lost, dtype=float)[:, None],
        "gripper_force": (
            zeros if force is None else np.array(force, dtype=float)[:, None]
        ),
    }
    fields = {
        name: {"unit": "", "meaning": "", "axes": axes} for name, axes in labels.items()
    }
    log = SimpleNamespace(
        time=0.1 * np.arange(len(taken)),
        component=arrays.__getitem__,
        info={
            "received": {
                "components": {"fields": fields, "every": 1, "late": 0, "frame": None}
            }
        },
    )
    log.agents = {"main": log}
    return log


def spans(log):
    return [
        (each.gripper, each.held, round(each.start, 9), each.end and round(each.end, 9))
        for each in grasp_periods(log)
    ]


def test_every_grasp_has_its_object_its_begin_and_its_end():
    assert spans(log_of([0, 1, 1, 0, 0, 2, 0])) == [
        ("g", "box", 0.1, 0.3),
        ("g", "peg", 0.5, 0.6),
    ]
    assert spans(log_of([0, 0, 0])) == []


def test_one_object_after_the_other_is_two_grasps_and_the_last_may_outlast_the_log():
    assert spans(log_of([1, 1, 2, 2])) == [
        ("g", "box", 0.0, 0.2),
        ("g", "peg", 0.2, None),
    ]


def test_grippers_have_grasps_of_their_own_in_the_order_of_time():
    assert spans(log_of([[0, 0, 1, 1], [0, 2, 2, 0]])) == [
        ("h", "peg", 0.1, 0.3),
        ("g", "box", 0.2, None),
    ]


def test_a_grasp_that_gave_way_says_so_with_its_peak():
    (found,) = grasp_periods(
        log_of([0, 1, 1, 0], lost=[0, 0, 0, 1], force=[9.0, 2.0, 3.0, 8.0])
    )
    assert found.gave_way
    assert found.peak == 3.0
    (found,) = grasp_periods(log_of([0, 1, 1, 0], lost=[0, 0, 0, 0]))
    assert not found.gave_way
