"""Studies of a scenario that changes in flight, and of what a change sets."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from skyarm import Change, ScenarioError, fly_sweep, run
from skyarm.scenario.scenario_file import LIBRARY
from skyarm.studies.sweep.plan import at_episode, prepare
from skyarm.studies.sweep.study_file import study_from

GAIN, SET = "controller.gains.position.x", "changes.1.value"
CHANGES = (
    Change(at=0.1, path="plant.gravity", value=9.7),
    Change(at=0.2, path="plant.payload.mass", value=0.05),
    Change(at=0.1, path=GAIN, value=6.0),
)


def changed_file(file: Path, changes: tuple[Change, ...]) -> None:
    """Write Case 1 with changes."""
    tables = [
        f'[[changes]]\nat = {each.at}\npath = "{each.path}"\nvalue = {each.value}\n'
        for each in changes
    ]
    file.write_text("\n".join([(LIBRARY / "case1.toml").read_text(), *tables]))


def study(folder: Path, **more: object) -> dict[str, object]:
    changed_file(folder / "mine.toml", CHANGES)
    vary = {SET: {"uniform": [0.0, 0.2]}, GAIN: {"uniform": [2.0, 5.0]}}
    small = {
        "schema": 1,
        "name": "set",
        "scenario": str(folder / "mine.toml"),
        "duration": 0.4,
        "episodes": 4,
    }
    return {
        **small,
        "vary": vary,
        "precision": "bit_exact",
        "metrics": ["position_error_max"],
        **more,
    }


def test_rows_are_the_runs_of_their_numbers(tmp_path: Path) -> None:
    given = study(tmp_path)
    rows = fly_sweep(given, tmp_path / "rows")
    (label,) = rows.controllers
    made = study_from(given)
    errors = rows.of(label, "position_error_max")
    assert len(set(errors)) == 4
    for k in range(4):
        numbers = {path: rows.of(label, path)[k] for path in (SET, GAIN)}
        log = run(at_episode(made, label, numbers, k))
        assert log.scenario.changes[1].value == numbers[SET]
        distance = np.linalg.norm(log.position - log.position_held, axis=1)[26:]
        assert errors[k] == pytest.approx(distance.max(), rel=1e-12)


def test_a_controller_of_the_study_flies_without_the_changes_of_the_files(
    tmp_path: Path,
) -> None:
    made = study_from(
        study(
            tmp_path,
            controllers=["paper_pd"],
            vary={"plant.gravity": {"uniform": [9.7, 9.9]}},
        )
    )
    (scenario,) = made.scenarios.values()
    assert [change.path for change in scenario.changes] == [
        "plant.gravity",
        "plant.payload.mass",
    ]
    # the numbers of the changes would be others
    with pytest.raises(
        ValueError,
        match=r"controllers: must be left out with vary.changes, since the scenario",
    ):
        study_from(
            study(
                tmp_path, controllers=["paper_pd"], vary={SET: {"uniform": [0.0, 0.2]}}
            )
        )


def test_the_stiffest_joint_that_a_change_brings_bounds_the_steps(
    tmp_path: Path,
) -> None:
    """Friction that a change raises, by a number that the study draws, needs the steps
    of its largest.
    """
    stiff = (Change(at=0.1, path="plant.joints.damping", value=0.002),)
    changed_file(tmp_path / "stiff.toml", stiff)
    vary = {"changes.0.value": {"uniform": [0.002, 0.02]}}
    plan = prepare(
        study_from(study(tmp_path, scenario=str(tmp_path / "stiff.toml"), vary=vary))
    )
    assert plan.stiffest.changes[0].value > 0.01, (
        "the largest that is drawn, not the file's"
    )


def test_when_a_change_comes_does_not_vary(tmp_path: Path) -> None:
    with pytest.raises(
        ValueError,
        match=(
            r"changes.0.at.*must be changes.NUMBER.value; when a change comes is"
            r" structu"
        ),
    ):
        study_from(study(tmp_path, vary={"changes.0.at": {"uniform": [0.0, 0.2]}}))
    with pytest.raises(
        ScenarioError,
        match=r"adds to changes\[1\].path = 'plant.payload.mass'; vary changes.1.value",
    ):
        fly_sweep(
            study(tmp_path, vary={"plant.payload.mass": {"uniform": [0.0, 0.2]}}),
            tmp_path / "rows",
        )
