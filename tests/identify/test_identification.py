"""An identification finds what it should: a study made of flights whose numbers are
known.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_studies import METRICS, STUDY, THICK

import skyarm
from inference.candidates import Candidates
from inference.checks import checked_study
from inference.evidence import Evidence
from inference.identification import identify, result_digest
from inference.study import IdentificationError, IdentificationStudy
from skyarm.log.metrics.score import score
from skyarm.paper.unstated_study import laid_over
from skyarm.plant.joint_rate import friction_rate
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_file import scenario_from

TRUE = {"clock": "early", "friction": 0.04, "late": 0.012}


def study_of(cells: str) -> IdentificationStudy:
    return checked_study(STUDY.replace("CELLS", cells).encode(), Path(), "small.toml")


@pytest.fixture(scope="module")
def study() -> IdentificationStudy:
    """Cells as the true settings make them, with six digits."""
    blank = study_of("\n".join(f'{name} = "1.0"' for name in METRICS))
    made = Candidates(blank).cells(blank.cells, TRUE)[0]
    return study_of(
        "\n".join(
            f'{cell.name} = "{value:.6f}"'
            for cell, value in zip(blank.cells, made, strict=True)
        )
    )


@pytest.fixture(scope="module")
def found(
    study: IdentificationStudy, tmp_path_factory: pytest.TempPathFactory
) -> dict[str, Any]:
    return identify(study, tmp_path_factory.mktemp("found") / "found.json", threads=2)


def test_candidates_are_flights_with_those_numbers(study: IdentificationStudy) -> None:
    values = Candidates(study).cells(study.cells, TRUE)[0]
    planned = with_numbers(
        scenario_from(study.scenario_tables("sines", TRUE)),
        study.numbers("sines", TRUE),
    )
    scored = score(skyarm.run(planned), METRICS, planned.windows)
    # in single precision
    assert values == pytest.approx([scored[name] for name in METRICS], rel=2e-3)


def test_the_fit_finds_the_numbers_that_the_cells_were_made_with(
    found: dict[str, Any],
) -> None:
    fit = found["stages"]["fit"]
    assert fit["settings"] == TRUE, (
        "to the digit: values are whole steps of each parameter"
    )
    assert fit["loss"] < 0.01
    assert fit["within_5%"] == fit["cells"] == len(METRICS)
    assert found["stages"]["stated"]["loss"] > 5.0


def test_numbers_found_on_some_cells_predict_the_others(found: dict[str, Any]) -> None:
    prediction = found["stages"]["prediction from_joints"]
    assert prediction["settings"]["friction"] == pytest.approx(0.04, abs=0.0021)
    assert (
        prediction["predicted"]["rest"]["loss"]
        < 0.1 * prediction["stated"]["rest"]["loss"]
    )
    assert prediction["cells"] + prediction["predicted"]["rest"]["cells"] == len(
        METRICS
    )


def test_the_ladder_ends_at_the_fit_and_counts_what_is_free(
    found: dict[str, Any],
) -> None:
    rungs = found["stages"]["ladder"]["rungs"]
    assert [(each["numbers"], each["choices"]) for each in rungs] == [
        (0, 0),
        (0, 1),
        (2, 1),
    ]
    assert rungs[0]["loss"] == found["stages"]["stated"]["loss"]
    assert rungs[-1]["loss"] == found["stages"]["fit"]["loss"]
    assert rungs[0]["loss"] > rungs[-1]["loss"]


def test_a_profile_is_lowest_at_the_fit_and_never_below_when_the_others_are_held(
    found: dict[str, Any],
) -> None:
    for name in ("friction", "late"):
        profile = found["stages"][f"profile {name}"]
        lowest = int(np.argmin(profile["refitted"]))
        assert profile["value"][lowest] == TRUE[name]
        assert all(
            a <= b + 1e-6
            for a, b in zip(profile["refitted"], profile["held"], strict=True)
        )
        assert profile["within_1"][0] <= TRUE[name] <= profile["within_1"][1]
        assert max(profile["held"]) > (1.0 if name == "friction" else 0.03)


def test_a_choice_taken_otherwise_is_worse_though_its_numbers_are_fitted_again(
    found: dict[str, Any],
) -> None:
    rows = {each["option"]: each for each in found["stages"]["choice clock"]["options"]}
    assert rows["early"]["taken"]
    assert rows["stated"]["loss"] > rows["early"]["loss"] + 1.0
    assert "choice measured" not in found["stages"], (
        "what only a rival takes is tried there"
    )


def test_a_rival_alone_and_on_top(found: dict[str, Any]) -> None:
    stiffness = found["stages"]["rival stiffness"]
    assert (
        stiffness["alone"]["joints"]["loss"] <= stiffness["alone"]["joints"]["stated"]
    )
    assert stiffness["on_top"]["numbers"]["stiffness"] == 350.0, (
        "nothing is left for it to explain"
    )
    measured = found["stages"]["rival measured"]
    assert measured["on_top"]["loss"] > found["stages"]["fit"]["loss"]


def test_threads_do_not_matter(study: IdentificationStudy) -> None:
    lanes = {"friction": np.linspace(0.0, 0.1, 9)}
    one, two = (
        Candidates(study, threads).cells(study.cells, {"clock": "early"}, lanes)
        for threads in (1, 2)
    )
    assert np.array_equal(one, two)
    assert len({tuple(row) for row in one.tolist()}) == 9


def test_a_stopped_study_goes_on_and_a_finished_one_flies_nothing(
    study: IdentificationStudy,
    found: dict[str, Any],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    file, told = tmp_path / "found.json", list[str]()

    def stop(_done: int, _total: int, name: str) -> None:
        told.append(name)
        if name == "ladder":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        identify(study, file, progress=stop)
    assert list(json.loads(file.read_text("utf-8"))["stages"]) == ["stated", "fit"]
    told.clear()
    kept = json.loads(file.read_text("utf-8"))
    kept["stages"] = dict(found["stages"])
    del kept["stages"]["ladder"]
    file.write_text(json.dumps(kept), "utf-8")
    again = identify(study, file, progress=lambda _d, _t, name: told.append(name))
    assert told == ["ladder", ""]
    assert again["stages"] == found["stages"], "and in the order of the study"
    monkeypatch.setattr(
        Evidence, "stages", lambda _self: dict.fromkeys(found["stages"])
    )
    assert identify(study, file)["stages"] == found["stages"]


@pytest.mark.parametrize(
    "content", ["", "{", "[]", '{"digest": 3}', '{"stages": {"fit": {}}}']
)
def test_a_file_that_is_of_no_study_is_begun_anew(
    study: IdentificationStudy, tmp_path: Path, content: str
) -> None:
    from inference.identification import _stages_there

    file = tmp_path / "found.json"
    file.write_text(content, "utf-8")
    assert _stages_there(file, result_digest(study)) == {}


def test_the_digest_is_of_study_cells_and_scenarios(study: IdentificationStudy) -> None:
    other = study_of("\n".join(f'{name} = "1.0"' for name in METRICS))
    assert other.digest != study.digest
    assert result_digest(other) != result_digest(study)
    same = study_of(
        "\n".join(f'{cell.name} = "{cell.measured:.6f}"' for cell in study.cells)
    )
    assert same.digest == study.digest


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("schema = 1", "schema = 2", r"^small\.toml: schema = 2: must be 1"),
        (
            "high = 0.1",
            "high = -1.0",
            r"parameters\[0\]\.high = -1\.0: must be above low",
        ),
        (
            'flights = ["*"], path = "delays',
            'flights = ["x"], path = "delays',
            r"targets\[0\]\.flights = 'x': must fit",
        ),
        (
            'free = ["friction", "late"]\nchoices',
            'free = ["drag"]\nchoices',
            r"fit\.free = 'drag': must be a parameter",
        ),
        (
            'clock = "early"',
            'clock = "never"',
            r"choices\.clock = 'never': must be one of stated, early",
        ),
        (
            'joint_error_mean = "1.0"',
            'joint_error_mean = "0"',
            r"joint_error_mean\.measured = '0': must be a number",
        ),
        (
            'joint_error_mean = "1.0"',
            "joint_error_mean = 1.0",
            r"joint_error_mean\.measured = 1\.0: must be a number",
        ),
        ('joint_error_mean = "1.0"', 'joy = "1.0"', r"metrics: 'joy': must be one of"),
        (
            '"sines/joint_*", ',
            '"sines/jaw_*", ',
            r"groups\.joints = 'sines/jaw_\*': must fit a cell",
        ),
        (
            'scenario = "case2"',
            'scenario = "case9"',
            r"flights\[0\]\.scenario = 'case9': must be a file",
        ),
        ("knee = 3.0", "knee = 0.0", r"loss\.knee = 0\.0: must be above 0"),
        (
            'seen = "joints"',
            'seen = "all"',
            r"predictions\[0\]\.seen = 'all': must be one of the groups: joints, rest",
        ),
        ("seed = 2", "seed = 2\nsead = 3", r"sead = 3: unknown field"),
    ],
)
def test_a_wrong_study_is_refused_in_one_line(old: str, new: str, words: str) -> None:
    text = STUDY.replace("CELLS", "\n".join(f'{name} = "1.0"' for name in METRICS))
    assert old in text
    with pytest.raises(IdentificationError, match=words) as caught:
        checked_study(text.replace(old, new, 1).encode(), Path(), "small.toml")
    assert "\n" not in str(caught.value)


def test_tables_laid_over_others() -> None:
    below = {"a": {"b": 1, "c": [1, 2]}, "d": 4}
    assert laid_over(below, {"a": {"c": [3]}, "d": {}}) == {"a": {"b": 1, "c": [3]}}
    assert below == {"a": {"b": 1, "c": [1, 2]}, "d": 4}


@pytest.mark.thorough
def test_machine_code_does_not_depend_on_who_asks_for_it_first(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A study that goes on after a stop asks in another order, and must find the same
    bits.

    Of two settings with the same paths one has the stiffer joints, which choose the
    integration step.
    """
    text = STUDY.replace(
        "CELLS", "\n".join(f'{name} = "1.0"' for name in METRICS)
    ).replace("[fit]", f"{THICK}[fit]")
    study = checked_study(text.encode(), Path(), "small.toml")

    class Asked:
        def __init__(
            self, scenario: Any, paths: Any, metrics: Any, stiffest: Any, effort: int
        ) -> None:
            self.base = dict.fromkeys(paths, 0.0)
            self.made = (tuple(paths), friction_rate(stiffest.plant.vehicle), effort)

        def values(self, columns: Any, threads: int) -> Any:
            told.append(self.made)
            return np.ones((len(columns), len(METRICS)))

    monkeypatch.setattr("inference.candidates.Flown", Asked)
    settings: list[dict[str, Any]] = [
        {},
        {"friction": 0.02},
        {"oil": "thick"},
        {"oil": "thick", "friction": 0.1},
        {"stiffness": 300.0},
        {"stiffness": 300.0, "oil": "thick"},
        {"measured": "late"},
    ]
    found = []
    for order in (settings, settings[::-1]):
        told: list[Any] = []
        candidates = Candidates(study)
        for each in order:
            candidates.cells(study.cells, each)
        found.append(told if order is settings else told[::-1])
    assert found[0] == found[1]
    rates = [rate for _, rate, _ in found[0]]
    assert rates[2] == rates[3] == rates[5] > rates[0] == rates[1] == rates[4]
