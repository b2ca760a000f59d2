"""Derived numbers of a study: several paths follow one named number."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from skyarm.studies.sweep import StudyError, design, study_from
from skyarm.studies.sweep.design import values
from skyarm.studies.sweep.maps import robustness_maps
from skyarm.studies.sweep.plan import at_episode, prepare
from skyarm.studies.sweep.stats import Pictures, Rows, page, statistics
from support.studies import document, flown, same, small_study

UPPER = "plant.vehicle.links.1.joint.position.z"
COM = "plant.vehicle.links.0.body.com.z"
BELIEF = "model.vehicle.links.1.joint.position.z"
WIND = "environment.wind.force_W.x"

ARM: dict[str, Any] = {
    "vary": {"arm": {"uniform": [0.1, 0.2]}, WIND: {"uniform": [0.5, 1.0]}},
    "derived": {
        UPPER: "-arm",
        COM: "-arm / 2",
        BELIEF: "-arm",
        "moment": f"arm * {WIND}",
        "plant.payload.mass": "moment / 100",
    },
}


@pytest.fixture(scope="module")
def rows(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder: Path = tmp_path_factory.mktemp("arm")
    flown(
        folder,
        episodes=20,
        chunk=8,
        duration=0.4,
        windows={"steady": [0.1, 0.4]},
        **ARM,
    )
    return folder


def test_rows_hold_what_was_derived(rows: Path) -> None:
    there = Rows(rows)
    assert there.parameters == (
        "arm",
        WIND,
        UPPER,
        COM,
        BELIEF,
        "moment",
        "plant.payload.mass",
    )
    for controller in there.controllers:
        arm, wind = there.of(controller, "arm"), there.of(controller, WIND)
        assert np.ptp(arm) > 0.05
        np.testing.assert_array_equal(there.of(controller, UPPER), -arm)
        np.testing.assert_array_equal(there.of(controller, COM), -arm / 2)
        np.testing.assert_array_equal(
            there.of(controller, "plant.payload.mass"), arm * wind / 100
        )


def test_flights_are_those_of_the_numbers_themselves(tmp_path: Path) -> None:
    """A study that derives four paths from one name, and one that varies the four: the
    same metrics to the bit.
    """
    common: dict[str, Any] = {
        "episodes": 3,
        "chunk": 8,
        "duration": 0.4,
        "windows": {"steady": [0.1, 0.4]},
    }
    derived = {UPPER: "-arm", COM: "-arm / 2", BELIEF: "-arm"}
    one = flown(
        tmp_path / "one", vary={"arm": {"list": [0.125]}}, derived=derived, **common
    )
    plain = {
        UPPER: {"list": [-0.125]},
        COM: {"list": [-0.0625]},
        BELIEF: {"list": [-0.125]},
    }
    other = flown(tmp_path / "other", vary=plain, **common)
    nominal = flown(
        tmp_path / "nominal", vary={"plant.payload.mass": {"list": [0.0]}}, **common
    )
    for controller in other:
        kept = {name: one[controller][name] for name in other[controller]}
        assert same(kept, other[controller])
        assert (
            kept["position_error_mean"] != nominal[controller]["position_error_mean"]
        ).all()


def test_an_episode_of_its_own_has_the_derived_numbers() -> None:
    study = small_study(**ARM)
    drawn = {name: float(column[0]) for name, column in values(study, [7]).items()}
    scenario = at_episode(study, "paper_ct", drawn, 7)
    arm = drawn["arm"]
    assert float(scenario.plant.vehicle.links[1].joint.position.z) == -arm
    assert (
        float(scenario.controller.par.model.vehicle.links[1].joint.position.z) == -arm
    )
    assert float(scenario.plant.vehicle.links[0].body.com.z) == -arm / 2


def test_draws_do_not_depend_on_what_is_derived() -> None:
    with_derived = values(small_study(**ARM), range(10))
    alone = values(
        small_study(vary={UPPER: ARM["vary"]["arm"], WIND: ARM["vary"][WIND]}),
        range(10),
    )
    np.testing.assert_array_equal(with_derived["arm"], alone[UPPER])
    np.testing.assert_array_equal(with_derived[WIND], alone[WIND])


def test_a_study_without_derived_numbers_is_written_as_before() -> None:
    assert "derived" not in small_study().document
    assert small_study(**ARM).document["derived"] == ARM["derived"]


def test_another_expression_is_another_study(rows: Path) -> None:
    other = {**ARM, "derived": {**ARM["derived"], COM: "-arm / 3"}}
    with pytest.raises(StudyError, match=r"derived = .*must be .*choose another --out"):
        flown(
            rows,
            episodes=20,
            chunk=8,
            duration=0.4,
            windows={"steady": [0.1, 0.4]},
            **other,
        )


def test_maps_and_the_page_take_derived_numbers(rows: Path) -> None:
    there = Rows(rows)
    found = robustness_maps(there, ("moment", UPPER))
    assert [each.across.path for each in found] == ["moment"] * 2
    text = page(statistics(there), there.manifest, Pictures())
    assert "moment / 100" in text


ERRORS: list[tuple[dict[str, Any], str]] = [
    (
        {"derived": {UPPER: "-leg"}},
        f"derived.\"{UPPER}\" = '-leg': at 2: 'leg' must be a named number",
    ),
    ({"derived": {UPPER: "exec(arm)"}}, "'exec' must not be called"),
    ({"derived": {UPPER: 3}}, f'derived."{UPPER}" = 3: must be an expression'),
    ({"derived": 3}, "derived = 3: must be a table"),
    ({"derived": {WIND: "arm"}}, "must not be under vary as well"),
    ({"derived": {"sqrt": "arm"}}, "must have another name than the function sqrt"),
    (
        {"derived": {"moment": "2 * length", "length": "arm"}},
        "'length' must be a named number",
    ),
    (
        {"derived": {"plant.vehicle.base.weight": "arm"}},
        'derived."plant.vehicle.base.weight": path',
    ),
    ({"derived": {"rates.control": "arm"}}, "rates is structure"),
    (
        {"derived": {"moment": WIND}},
        'vary."arm": must be a path, or be used by an expression under derived',
    ),
    ({"derived": None}, "vary.\"arm\": path = 'arm': must start with one of plant"),
]


@pytest.mark.parametrize(
    ("fields", "words"), ERRORS, ids=[words[:30] for _, words in ERRORS]
)
def test_a_wrong_expression_is_named(fields: dict[str, Any], words: str) -> None:
    with pytest.raises(StudyError) as caught:
        study_from(document(**{**ARM, **fields}))
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("derived", "words"),
    [
        (
            {"plant.vehicle.base.mass": "arm - 0.15"},
            'derived."plant.vehicle.base.mass" reaches -0.0',
        ),
        (
            {COM: "1 / (arm - arm)"},
            f"derived.\"{COM}\" = '1 / (arm - arm)': at 1: must not divide by zero",
        ),
        ({COM: "sqrt(arm - 0.15)"}, "must take the root of a number of at least 0"),
    ],
)
def test_what_an_episode_cannot_fly_is_known_before_any_flies(
    derived: dict[str, str], words: str
) -> None:
    with pytest.raises(StudyError) as caught:
        prepare(study_from(document(**{**ARM, "derived": derived})))
    assert words in str(caught.value)


def test_two_names_of_one_number_are_refused() -> None:
    twice = {
        **ARM,
        "derived": {
            UPPER: "-arm",
            "plant.vehicle.links.link2.joint.position.z": "-arm",
        },
    }
    with pytest.raises(StudyError, match="is the same number as"):
        prepare(study_from(document(**twice)))


def test_numbers_that_are_allowed_together_only_fly() -> None:
    """Each moment of inertia alone breaks the triangle inequality; all three grow
    together.
    """
    inertia = {
        f"plant.vehicle.links.1.body.inertia.{i}": "k * 1e-4" for i in ("xx", "yy")
    }
    alone = {path: {"list": [5e-2]} for path in list(inertia)[:1]}
    with pytest.raises(StudyError, match="reaches"):
        prepare(study_from(document(vary=alone)))
    prepare(study_from(document(vary={"k": {"list": [500.0]}}, derived=inertia)))


def test_the_stiffest_joint_friction_is_found_among_derived_numbers() -> None:
    damping = "plant.vehicle.links.0.joint.damping"
    plain = prepare(
        study_from(document(vary={damping: {"uniform": [0.001, 0.5]}}))
    ).stiffest
    derived = prepare(
        study_from(
            document(vary={"d": {"uniform": [0.001, 0.5]}}, derived={damping: "d"})
        )
    ).stiffest
    found = [
        float(each.plant.vehicle.links[0].joint.damping) for each in (plain, derived)
    ]
    assert found[0] > 0.4
    assert found[1] == found[0]


def test_extremes_are_those_of_all_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(design, "BLOCK", 7)
    study = small_study(**ARM)
    drawn = values(study, range(study.episodes))
    for path, (_, _, smallest, largest) in design.extremes(study).items():
        assert drawn[path][smallest] == drawn[path].min()
        assert drawn[path][largest] == drawn[path].max()
