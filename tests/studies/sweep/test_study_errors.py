"""Wrong studies: one line, field, value, what is allowed, before anything flies."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from skyarm.studies.sweep import StudyError, list_studies, load_study, study_from
from skyarm.studies.sweep.plan import prepare
from support.studies import MASS, WIND, document, small_study

ERRORS: list[tuple[dict[str, Any], str]] = [
    ({"schema": 2}, "schema = 2: must be 1"),
    ({"schema": None}, "schema: is missing"),
    ({"name": None}, "name: is missing"),
    ({"name": "a/b"}, "name = 'a/b': must be 1 to 100 letters"),
    ({"title": 3}, "title = 3: must be text"),
    ({"extra": 1}, "extra = 1: unknown field; allowed: schema, "),
    ({"episodes": None}, "episodes: is missing"),
    ({"episodes": 0}, "episodes = 0: must be a whole number from 1 to"),
    ({"episodes": 2.5}, "episodes = 2.5: must be a whole number"),
    ({"episodes": True}, "episodes = True: must be a whole number"),
    ({"chunk": 0}, "chunk = 0: must be a whole number from 1 to 1048576"),
    ({"seed": -1}, "seed = -1: must be a whole number from 0"),
    (
        {"precision": "half"},
        "precision = 'half': must be one of double, single, bit_exact",
    ),
    ({"design": "latin"}, "design = 'latin': must be one of random, grid, sobol"),
    ({"design": "grid"}, "design = 'grid': must come with a grid or a list under vary"),
    (
        {"design": "grid", "vary": {MASS: {"grid": [0.5, 1, 3]}}, "episodes": 50},
        "multiple of the grid's 3 cells",
    ),
    (
        {"design": "sobol", "vary": {}},
        "vary = 0 numbers: must be 1 to 21 in a sobol design",
    ),
    ({"duration": 0}, "duration = 0: must be above 0"),
    (
        {"windows": {"steady": [2, 1]}},
        "windows.steady = [2, 1]: must start before it stops",
    ),
    ({"windows": {"steady": 3}}, "windows.steady = 3: must be [start, stop] in s"),
    ({"windows": {"early": [0, 1]}}, "windows.early = [0, 1]: unknown field"),
    (
        {"scenario": "case9"},
        (
            "scenario = 'case9': did you mean 'case3'? must be the path of a .toml file"
            " or a log, or a name; shipped scenarios are"
        ),
    ),
    ({"scenario": 9}, "scenario = 9: must be the name of a shipped scenario or a path"),
    (
        {"controllers": ["lqr"]},
        "controller = 'lqr': must be a preset, a law or LAW_tuned (",
    ),
    ({"controllers": []}, "controllers = []: must be a list of different presets"),
    ({"controllers": ["paper_ct", "paper_ct"]}, "must be a list of different presets"),
    (
        {"vary": {"mass": {"uniform": [0, 1]}}},
        "vary.\"mass\": path = 'mass': must start with one of plant, model",
    ),
    (
        {"vary": {"plant.vehicle.base.weight": {"uniform": [0, 1]}}},
        "no 'weight' here; there are mass, com, inertia",
    ),
    (
        {"vary": {"plant.vehicle.base": {"uniform": [0, 1]}}},
        "must lead to a number, not to Body",
    ),
    ({"vary": {"reference.x": {"uniform": [0, 1]}}}, 'vary."reference.x": path = '),
    (
        {"vary": {"reference.base.width": {"uniform": [0, 1]}}},
        "no 'width' here; there are x, y, z, radius, frequency_hz",
    ),
    (
        {"vary": {"rates.control": {"uniform": [0, 1]}}},
        "rates is structure, the same for all episodes",
    ),
    ({"vary": {"delays.command": {"uniform": [0, 1]}}}, "delays is structure"),
    ({"vary": {"duration": {"uniform": [1, 2]}}}, "duration is structure"),
    (
        {"vary": {"plant.payload.hand.mass": {"uniform": [0, 1]}}},
        "no 'hand' here; there are mass, tip",
    ),
    (
        {"metrics": ["speed"]},
        (
            "metrics: 'speed': must be one of standard, gust, wind, paper, effort,"
            " contact, team, all, or of position"
        ),
    ),
    ({"metrics": "all"}, "metrics = 'all': must be a list of names"),
    (
        {"windows": {"holds": [[1, 2, 3]]}},
        "windows.holds[0] = [1, 2, 3]: must be [start, stop] in s",
    ),
    (
        {"metrics": ["gust"], "success": {"roll_rms": 1}},
        "success.roll_rms: is no metric of this study; there are gust",
    ),
    (
        {"vary": {MASS: {"uniform": [2, 1]}}},
        f'vary."{MASS}".uniform = [2, 1]: must be two numbers',
    ),
    ({"vary": {MASS: 3}}, f'vary."{MASS}" = 3: must be a table'),
    ({"vary": 3}, "vary = 3: must be a table"),
    (
        {"success": {"error": 1}},
        "success.error: is no metric of this study; there are position_error_mean",
    ),
    (
        {"success": {"peak_pitch": "low"}},
        "success.peak_pitch = 'low': must be a finite number",
    ),
]


@pytest.mark.parametrize(
    ("fields", "words"), ERRORS, ids=[words[:40] for _, words in ERRORS]
)
def test_a_wrong_field_is_named_with_what_is_allowed(
    fields: dict[str, Any], words: str
) -> None:
    with pytest.raises(StudyError) as caught:
        study_from(document(**fields))
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("vary", "words"),
    [
        (
            {MASS: {"uniform": [-1.0, 1.0]}},
            (f'vary."{MASS}" reaches -0.', "base.mass", "at least 0"),
        ),
        ({MASS: {"normal": [0.7, 0.5]}}, (f'vary."{MASS}" reaches -', "at least 0")),
        (
            {"plant.vehicle.base.inertia.xx": {"uniform": [0.0, 1.0]}},
            ("inertia.xx", "triangle inequality"),
        ),
        (
            {"plant.vehicle.links.0.joint.coulomb": {"uniform": [0.0, 90.0]}},
            ("coulomb", "joint friction decays"),
        ),
    ],
)
def test_a_number_that_some_episode_cannot_fly_with_is_refused_before_any_flies(
    vary: dict[str, Any], words: tuple[str, ...]
) -> None:
    study = small_study(vary=vary, episodes=1000)
    with pytest.raises(StudyError, match=r"^study: vary") as caught:
        prepare(study)
    for word in words:
        assert word in str(caught.value), caught.value
    assert "\n" not in str(caught.value)


def test_a_study_on_the_other_plant_is_refused(tmp_path: Path) -> None:
    from skyarm.scenario.scenario_file import LIBRARY

    text = (
        (LIBRARY / "case1.toml")
        .read_text("utf-8")
        .replace("[plant]\n", '[plant]\nkind = "mujoco"\n')
    )
    (tmp_path / "flight.toml").write_text(text)
    with pytest.raises(StudyError, match=r"plant\.kind = 'mujoco': must be rigid_body"):
        study_from(document(scenario="flight.toml", vary=None), tmp_path)


def test_a_file_is_named_in_its_errors(tmp_path: Path) -> None:
    path = tmp_path / "wrong.toml"
    path.write_text("schema = 1\nname = 'x'\nepisodes = 0\n")
    with pytest.raises(StudyError, match=r"wrong\.toml: episodes = 0"):
        load_study(path)
    path.write_text("schema = \n")
    with pytest.raises(StudyError, match=r"wrong\.toml: TOML"):
        load_study(path)
    with pytest.raises(StudyError, match=r"no such file|is a folder|must be readable"):
        load_study(tmp_path / "nowhere.toml")
    with pytest.raises(StudyError, match="shipped studies are carrying, robustness"):
        load_study("robust")


def test_a_structural_zero_may_be_varied() -> None:
    study = small_study(
        scenario="case1", vary={"sensors.rate": {"uniform": [0.0, 0.1]}}
    )
    assert study.scenarios["paper_ct"].noise.rate == 0.0
    assert isinstance(study.scenarios["paper_ct"].noise.rate, float), (
        "data, not structure"
    )
    calm = small_study(
        scenario="case1",
        vary={"environment.wind.velocity_W.x": {"uniform": [0.0, 1.0]}},
    )
    assert isinstance(calm.scenarios["paper_ct"].wind.velocity_W.x, float)


def test_every_shipped_study_loads_and_can_be_prepared() -> None:
    assert list_studies() == ("carrying", "robustness")
    for name in list_studies():
        study = load_study(name)
        assert study.name == name
        assert study.title
        prepare(study)


def test_the_wind_is_a_number_of_the_small_study() -> None:
    assert WIND in small_study().paths


def test_a_study_says_which_plugins_it_needs() -> None:
    with pytest.raises(
        StudyError,
        match=r"plugins\.need = 'gusty.py': is not loaded; --plugin gusty.py",
    ):
        study_from(document(plugins={"need": ["gusty.py"]}))
    with pytest.raises(StudyError, match=r"plugins\.want = 1: unknown field"):
        study_from(document(plugins={"want": 1}))
    assert (
        study_from(document(plugins={"need": []})).document
        == study_from(document()).document
    )
