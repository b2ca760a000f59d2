"""The stages of a study on candidates whose cells are known formulas: nothing flies."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_studies import METRICS, STUDY, THICK

from inference.evidence import Evidence, _range
from inference.study import read_identification
from skyarm.paper.unstated_study import losses

TEXT = STUDY.replace(
    "CELLS", "\n".join(f'{name} = "1.000"' for name in METRICS)
).replace("[fit]", f"{THICK}[fit]")
STUDIED = read_identification(
    TEXT.replace("generations = 10", "generations = 0")
    .replace("population = 16", "population = 8")
    .encode(),
    Path(),
    "small.toml",
)


class Formulas:
    """Joint cells are 1 at friction 0.04, others at 0.06, at a delay of 12 ms; all are
    1.5 off without the clock.
    """

    def __init__(self) -> None:
        self.searched: list[int] = []

    def cells(self, cells: Any, fixed: Any, varied: Any = None) -> Any:
        told = {**fixed, **(varied or {})}
        count = max(
            (np.size(each) for each in told.values() if not isinstance(each, str)),
            default=1,
        )
        friction, late, stiff = (
            told.get(name, usual)
            for name, usual in zip(NAMES, (0.0, 0.0, 350.0), strict=True)
        )
        off = 1.0 if told.get("clock") == "early" else 1.5
        off *= 2.0 if told.get("measured") == "late" else 1.0
        found = []
        for cell in cells:
            middle = 0.04 if cell.name.startswith(("joint", "tau")) else 0.06
            far = (
                20.0 * abs(friction - middle)
                + 10.0 * abs(late - 0.012)
                + 0.001 * abs(stiff - 420.0)
            )
            found.append(np.broadcast_to(off * np.exp(far), (count,)))
        return np.array(found).T

    def loss(self, cells: Any, fixed: Any, varied: Any = None) -> Any:
        if varied:
            self.searched.append(len(cells))
        return losses(self.cells(cells, fixed, varied), cells, 0.25, 3.0).sum(axis=1)


NAMES = ("friction", "late", "stiffness")


def stage(name: str, done: Any = None, study: Any = STUDIED) -> tuple[Any, Formulas]:
    formulas = Formulas()
    fitted = {"fit": {"settings": {"clock": "early", "friction": 0.04, "late": 0.012}}}
    return Evidence(study, formulas).stages()[name](done or fitted), formulas


def test_the_compass_ends_what_the_evolution_leaves() -> None:
    """Without a generation of evolution the best of eight even points is left."""
    found, _ = stage("prediction from_joints")
    assert found["settings"] == {"clock": "early", "friction": 0.04, "late": 0.012}
    assert found["loss"] < 0.5, "what is left is of the stiffness"
    fit, formulas = stage("fit")
    assert (fit["free"], fit["choices"], fit["settings"]["clock"]) == (2, 1, "early")
    assert set(formulas.searched) == {6}


def test_groups_are_judged_where_all_of_their_cells_are() -> None:
    found, _ = stage("stated")
    assert set(found["groups"]) == {"joints", "rest"}
    assert (
        sum(each["cells"] for each in found["groups"].values()) == found["cells"] == 6
    )
    assert found["loss"] == pytest.approx(
        sum(each["loss"] for each in found["groups"].values()), abs=0.002
    )
    prediction, formulas = stage("prediction from_joints")
    assert set(prediction["groups"]) == {"joints"}
    assert set(formulas.searched) == {4}, "the others are not searched on"
    assert prediction["predicted"]["rest"]["cells"] == 2
    assert set(prediction["stated"]) == {"joints", "rest"}
    assert (
        prediction["stated"]["rest"]["loss"]
        > prediction["predicted"]["rest"]["loss"]
        > 0.0
    )


def test_a_choice_that_is_not_of_the_fit_is_taken_as_stated() -> None:
    found, _ = stage("choice oil")
    assert [(each["option"], each["taken"]) for each in found["options"]] == [
        ("thin", True),
        ("thick", False),
    ]
    clock, _ = stage("choice clock")
    assert [each["taken"] for each in clock["options"]] == [False, True]
    assert clock["options"][0]["loss"] > clock["options"][1]["loss"] + 1.0


def test_a_rival_is_judged_alone_by_what_is_stated_and_on_top_by_the_fit() -> None:
    stiffness, _ = stage("rival stiffness")
    alone = stiffness["alone"]["joints"]
    joints = STUDIED.among("joints")
    assert alone["stated"] == pytest.approx(
        float(Formulas().loss(joints, {})[0]), abs=1e-3
    )
    assert alone["numbers"]["stiffness"] == 420.0, (
        "to the parameter's step: a finer grid around the best of the first"
    )
    assert stiffness["on_top"]["numbers"]["stiffness"] == 420.0
    assert stiffness["on_top"]["loss"] < alone["loss"]
    measured, _ = stage("rival measured")
    assert measured["alone"]["joints"]["loss"] > measured["alone"]["joints"]["stated"]
    replaced = dataclasses.replace(STUDIED.plan.rivals[0], without=("friction",))
    plan = dataclasses.replace(STUDIED.plan, rivals=(replaced,))
    other, _ = stage("rival stiffness", study=dataclasses.replace(STUDIED, plan=plan))
    assert other["on_top"]["loss"] > stiffness["on_top"]["loss"] + 1.0


def test_the_range_of_a_profile_is_where_the_loss_grows_by_at_most_1() -> None:
    values = np.array([0.0, 0.1, 0.2, 0.3, 0.4])
    assert _range(values, np.array([9.0, 3.0, 2.0, 3.0, 3.001])) == [0.1, 0.3]
    assert _range(values, np.array([5.0, 5.0, 1.0, 5.0, 5.0])) == [0.2, 0.2]
