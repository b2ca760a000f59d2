"""Studies that cannot mean anything are refused in one line, before anything flies;
what they may say in more ways.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from small_studies import METRICS, STUDY

from inference import identification
from inference.candidates import Candidates
from inference.checks import checked_study
from inference.identification import identify
from inference.study import IdentificationError
from skyarm.scenario.scenario_file import LIBRARY
from skyarm.vehicle.vehicle_files import LIBRARY as VEHICLES

TEXT = STUDY.replace("CELLS", "\n".join(f'{name} = "1.0"' for name in METRICS))


def read(*changes: tuple[str, str], folder: Path = Path()) -> Any:
    text = TEXT
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    return checked_study(text.encode(), folder, "small.toml")


AGAIN = '[[parameters]]\nname = "friction"\nlow = 0.0\nhigh = 1.0\nstep = 0.1\n'

OTHER_CLOCK = '[[choices]]\nname = "clock"\noptions = [{ name = "stated" }]\n'

FRICTION = (
    'targets = [{ flights = ["*"], path = "plant.vehicle.links.0.joint.damping" }]'
)


WRONG = [
    # a text in place of a list is not taken letter by letter
    (
        'free = ["friction", "late"]\nchoices',
        'free = "friction"\nchoices',
        "fit.free = 'friction': must be a list",
    ),
    (
        'flights = ["*"], path = "delays',
        'flights = "*", path = "delays',
        "flights = '*': must be a list",
    ),
    ('over = ["short"]', 'over = "short"', "flights[0].over = 'short': must be a list"),
    ('adds = ["clock"]', 'adds = "clock"', "ladder[0].adds = 'clock': must be a list"),
    (
        'unseen = ["rest"]',
        'unseen = "rest"',
        "predictions[0].unseen = 'rest': must be a list",
    ),
    # names
    (
        "[[parameters]]",
        f"{AGAIN}[[parameters]]",
        "parameters.name = 'friction': must be there once",
    ),
    (
        "[[choices]]",
        f"{OTHER_CLOCK}[[choices]]",
        "choices.name = 'clock': must be there once",
    ),
    (
        "[[choices]]",
        f"{OTHER_CLOCK.replace('clock', 'late')}[[choices]]",
        "choices.name = 'late': must be",
    ),
    (
        'name = "measured"\nwords = "late',
        'name = "stiffness"\nwords = "late',
        "rivals.name = 'stiffness': must be",
    ),
    (
        'name = "at_once"',
        'name = "late"',
        "choices[1].options.name = 'late': must be there once",
    ),
    (
        'free = ["friction", "late"]\nchoices',
        'free = ["late", "late"]\nchoices',
        "fit.free = 'late': must be",
    ),
    (
        'adds = ["friction", "late"]',
        'adds = ["clock", "late"]',
        "ladder.adds = 'clock': must be there once",
    ),
    (
        'adds = ["friction", "late"]',
        'adds = ["stiffness"]',
        "ladder.adds = 'stiffness': must be of the fit",
    ),
    ('name = "small"', 'name = ""', "name = '': must be text"),
    ('name = "small"', "name = 3", "name = 3: must be text"),
    ('name = "friction"\n', "name = 3\n", "parameters[0].name = 3: must be text"),
    (
        'name = "motion"\n',
        'name = "motion"\nsteps = 3\n',
        "ladder[0].steps = 3: unknown field",
    ),
    # what there is to fit
    (
        'free = ["friction", "late"]\nchoices',
        "free = []\nchoices",
        "fit.free = []: must have at least one",
    ),
    (
        'free = ["friction", "late"]\nchoices = { clock = "early" }\nseen',
        "free = []\nseen",
        "predictions[0].free = []: must have at least one parameter",
    ),
    (
        (
            '[[choices.options]]\nname = "at_once"\n[[choices.options]]\nname ='
            ' "late"\ntables = [{ flights = ["*"], table = "late" }]\n'
        ),
        "options = []\n",
        "choices[1].options: must have",
    ),
    # numbers
    (
        "low = 0.0\nhigh = 0.1",
        "low = nan\nhigh = 0.1",
        "parameters[0].low = nan: must be a finite number",
    ),
    (
        "low = 0.0\nhigh = 0.1",
        "low = 0.1\nhigh = 0.1",
        "parameters[0].high = 0.1: must be above low = 0.1",
    ),
    (
        "step = 0.001",
        "step = 0.0",
        "parameters[0].step = 0.0: must be from a millionth",
    ),
    (
        "step = 0.001",
        "step = 1e-12",
        "parameters[0].step = 1e-12: must be from a millionth of high - low",
    ),
    (
        "step = 0.001",
        "step = 0.2",
        "parameters[0].step = 0.2: must be from a millionth",
    ),
    ("step = 0.001", 'step = 0.001\nscale = "log"', "which is above 0 on a log scale"),
    ("seed = 2", "seed = 1.5", "seed = 1.5: must be a whole number"),
    ("seed = 2", "seed = -1", "seed = -1: must be a whole number from 0"),
    (
        "population = 16",
        "population = 4.5",
        "search.population = 4.5: must be a whole number",
    ),
    (
        "population = 16",
        "population = 1000000000",
        "must be a whole number from 4 to 100000",
    ),
    ("width = 0.25", "width = -1", "loss.width = -1.0: must be above 0"),
    ("schema = 1", "schema = true", "schema = True: must be a whole number"),
    # targets
    (
        FRICTION,
        FRICTION.replace("damping", "dumping"),
        "parameters[0].targets[0]: flights.sines: path = ",
    ),
    (
        FRICTION,
        FRICTION.replace('" }', '", factr = 2.0 }'),
        "targets[0].factr = 2.0: unknown field; did you mean 'factor'? allowed",
    ),
    (
        FRICTION,
        FRICTION.replace('" }', '", value = 2.0 }'),
        "targets[0].value = 2.0: unknown field; allowed",
    ),
    (
        FRICTION,
        FRICTION.replace('" }', '", when = { clok = "early" } }'),
        "parameters[0].targets[0].when.clok = 'early': must be one of clock, measured",
    ),
    (
        FRICTION,
        FRICTION.replace('" }', '", when = { clock = "late" } }'),
        "parameters[0].targets[0].when.clock = 'late': must be one of stated, early",
    ),
    (
        FRICTION,
        FRICTION.replace('" }', '", when = { clock = 3 } }'),
        "targets[0].when.clock = 3: must be one of",
    ),
    (
        'choices = { clock = "early" }',
        "choices = { clock = 3 }",
        "fit.choices.clock = 3: must be one of",
    ),
    (
        'choices = { clock = "early" }',
        "choices = { clock = [] }",
        "fit.choices.clock = []: must be one of",
    ),
    (
        "[tables.short]",
        "[tables]\nother = 3\n[tables.short]",
        "tables.other = 3: must be a table",
    ),
    # flights
    (
        'scenario = "case2"',
        "scenario = 3",
        "flights[0].scenario = 3: must be a file beside this one (no text)",
    ),
    (
        'scenario = "case2"',
        'scenario = "."',
        "flights[0].scenario = '.': must be a file beside",
    ),
    (
        "duration = 3.0",
        "duration = -3.0",
        "flights.sines: duration = -3.0: must be above 0",
    ),
    *(
        (
            f'{METRICS[0]} = "1.0"',
            f"{METRICS[0]} = {value}",
            "must be a number other than 0, as text",
        )
        for value in ('"nan"', '"inf"', '"-0.0"', '"three"', '""', "true", "[1]")
    ),
    (
        f'{METRICS[0]} = "1.0"',
        f"{METRICS[0]} = {{ metric = 'x' }}",
        "measured: is missing",
    ),
]


def test_hostile_studies_are_refused_in_one_line() -> None:
    missed = []
    for old, new, words in WRONG:
        with pytest.raises(IdentificationError) as caught:
            read((old, new))
        message = str(caught.value)
        if (
            not message.startswith("small.toml: ")
            or words not in message
            or "\n" in message
        ):
            missed.append((words, message))
    assert missed == []


def test_no_cells_are_no_study() -> None:
    with pytest.raises(
        IdentificationError,
        match=r"^small\.toml: flights: must have cells, at least one$",
    ):
        checked_study(
            b'schema = 1\nname = "s"\nloss = { width = 1.0, knee = 1.0 }\n'
            b"search = { population = 4, generations = 0 }\n"
            b'[[flights]]\nname = "a"\nscenario = "case1"\n',
            Path(),
            "small.toml",
        )


@pytest.mark.parametrize(
    ("text", "measured", "half"),
    [
        ("0.0305", 0.0305, 0.00005),
        ("3.05e-2", 0.0305, 0.00005),
        ("1e-3", 0.001, 0.0005),
        ("250", 250.0, 0.5),
        ("2.5e2", 250.0, 5.0),
        (" -0.40 ", -0.4, 0.005),
        ("1.", 1.0, 0.5),
    ],
)
def test_half_a_unit_of_the_last_digit_whatever_the_notation(
    text: str, measured: float, half: float
) -> None:
    cell = read((f'{METRICS[0]} = "1.0"', f'{METRICS[0]} = "{text}"')).cells[0]
    assert (cell.measured, cell.half) == (measured, pytest.approx(half, rel=1e-12))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "high = 0.1",
            "high = 900.0",
            r"^fit: friction = 900: flights\.sines: .*joint friction decays",
        ),
        (
            "low = 0.0\nhigh = 0.03",
            "low = -0.01\nhigh = 0.03",
            r"^fit: late = -0\.01: flights\.sines: delays\.rotors = -",
        ),
        (
            "high = 0.03\n",
            "high = 0.06\n",
            r"^fit: late = 0\.06: flights\.sines: delays\.rotors = 0\.06",
        ),
    ],
)
def test_a_range_that_a_flight_cannot_have_is_refused_before_anything_flies(
    old: str, new: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Candidates, "cells", lambda *_: pytest.fail("flown"))
    with pytest.raises(ValueError, match=words) as caught:
        identify(read((old, new)), tmp_path / "found.json")
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_a_scenario_beside_the_study_names_vehicles_beside_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "inner").mkdir()
    text = (LIBRARY / "case2.toml").read_text("utf-8")
    vehicle = text.split('vehicle = "')[1].split('"')[0]
    own = (VEHICLES / f"{vehicle}.toml").read_text("utf-8")
    (tmp_path / "inner" / "own.toml").write_text(own)
    (tmp_path / "inner" / "flight.toml").write_text(
        text.replace(f'vehicle = "{vehicle}"', 'vehicle = "own.toml"', 1)
    )
    monkeypatch.chdir(tmp_path)
    study = read(
        ('scenario = "case2"', 'scenario = "inner/flight.toml"'), folder=tmp_path
    )
    before = identification.result_digest(study)
    monkeypatch.chdir(tmp_path.parent)
    assert identification.result_digest(study) == before
    (tmp_path / "inner" / "own.toml").write_text(own.replace("mass = 0.", "mass = 1."))
    assert identification.result_digest(study) != before
    (tmp_path / "inner" / "flight.toml").write_text("[plant\n")
    with pytest.raises(
        IdentificationError, match=r"flights\[0\]\.scenario = 'inner/flight\.toml': "
    ):
        read(('scenario = "case2"', 'scenario = "inner/flight.toml"'), folder=tmp_path)


def test_a_target_acts_only_under_the_option_that_it_names() -> None:
    study = read((FRICTION, FRICTION.replace('" }', '", when = { clock = "early" } }')))
    path = "plant.vehicle.links.0.joint.damping"
    assert path not in study.numbers("sines", {"friction": 0.04})
    assert path not in study.numbers("sines", {"friction": 0.04, "clock": "stated"})
    assert study.numbers("sines", {"friction": 0.04, "clock": "early"})[path] == 0.04
