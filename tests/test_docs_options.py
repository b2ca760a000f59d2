"""Options of the laws as the generated tables list them: all of them, with the defaults
that they have.
"""

import re
import tomllib

import numpy as np
import pytest

from skyarm.control.catalogue import LAWS
from skyarm.control.laws.centroidal.adaptation import FRICTION
from skyarm.control.laws.centroidal.options import ENTRIES, PERIODS, RANGES, VALUES
from skyarm.records.leaves import leaves
from skyarm.scenario.controller_table import law_words, option_words
from skyarm.scenario.scenario_file import scenario_from
from support.pages import DOCS, law_equations, law_rows
from website.generated_blocks import heads


def documented(law):
    """Option -> the cell of its default."""
    return {
        option: row["default"]
        for option, row in law_rows(law).items()
        if "." not in option
    }


def made(law, **options):
    vehicle = {
        "plant": {"vehicle": "hummingbird_arm2_rotors"},
        "model": {"vehicle": "hummingbird_arm2"},
    }
    hover = {"base": {"kind": "hover", "position": [0.0, 0.0, 2.0]}}
    controller = {"law": law, **options}
    return scenario_from(
        {
            "name": "x",
            "duration": 0.1,
            **vehicle,
            "reference": hover,
            "controller": controller,
        }
    )


@pytest.mark.parametrize("law", LAWS)
def test_the_options_of_a_law_are_those_that_the_page_lists(law):
    assert set(documented(law)) == {*option_words(law)}
    assert set(documented(law)) == set(law_words(law)) - {"tuned", "safety", "servos"}


def test_every_law_has_its_table_on_a_page():
    """Each on the card of its law; a person puts the block there."""
    assert {*LAWS} - {
        head.split()[1] for head in heads() if head.startswith("law ")
    } == set()


@pytest.mark.parametrize("law", LAWS)
def test_every_option_has_type_default_and_meaning(law):
    for option, row in law_rows(law).items():
        assert row["meaning"] not in ("", "-"), option
        assert row["type and unit"] not in ("", "-"), option
        assert "." in option or row["default"] not in ("", "-"), option


@pytest.mark.parametrize("law", LAWS)
def test_a_default_on_the_page_changes_nothing_when_it_is_written_out(law):
    plain = made(law).controller
    for option, default in documented(law).items():
        if not default.startswith("`"):
            continue
        value = tomllib.loads(f"x = {default.strip('`')}")["x"]
        written = made(law, **{option: value}).controller
        assert leaves(written.par) == leaves(plain.par), option
        assert option in NO_LIMITS or other_or_refused(
            law, {option: made_other(value)}, plain
        ), option


NO_LIMITS = ("preview",)
"""Options without an effect in mode "joint"."""


def made_other(value):
    """Another value of the same kind."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, list):
        return [each * 1.5 if each else 0.01 for each in value] or ["coriolis"]
    if isinstance(value, dict):
        return {key: each * 1.5 for key, each in value.items()}
    return (
        value + 1
        if isinstance(value, int)
        else value * 0.5 + 0.042
        if isinstance(value, float)
        else "other"
    )


def other_or_refused(law, options, plain):
    """The option is read: another value makes other constants, or is refused by
    name.
    """
    try:
        found = made(law, **options).controller
    except ValueError as error:
        return next(reversed(options)) in str(error)
    return found.par != plain.par


def test_the_weights_on_the_page_are_the_laws():
    rows = {
        name.partition(".")[2]: row
        for name, row in law_rows("nmpc").items()
        if name.startswith("weights.")
    }
    weights = {name: float(row["default"].strip("`")) for name, row in rows.items()}
    assert leaves(made("nmpc", weights=weights).controller.par) == leaves(
        made("nmpc").controller.par
    )
    assert set(weights) == set(made("nmpc").controller.par.weights.__slots__)


def test_defaults_of_the_centroidal_law_are_those_that_it_has():
    rows = law_rows("centroidal")
    for entry in ENTRIES:
        shown, held = rows[entry]["default"], VALUES[entry]
        numbers = list(held) if isinstance(held, tuple) else held
        if shown.startswith("`"):
            assert tomllib.loads(f"x = {shown.strip('`')}")["x"] == numbers, entry
        else:  # by the vehicle: the cell begins with the numbers
            assert re.match(
                rf"{', '.join(f'{each:g}' for each in np.ravel(held))}[,;] ", shown
            ), entry


def test_ranges_on_the_page_are_those_that_are_checked():
    rows = law_rows("centroidal")
    for entry, (low, high) in RANGES.items():
        assert rows[entry]["allowed"].startswith(f"{low:g} to {high:g}"), entry
    for entry in ("control_period", "reference_period"):
        assert rows[entry]["allowed"].startswith("{:g} to {:g}".format(*PERIODS)), entry


def test_numbers_on_the_page_of_the_centroidal_law_are_those_that_it_has():
    text = " ".join(law_equations().split())
    assert f"`reach` ({VALUES['reach']:g} m," in text
    assert f"`damping` ({VALUES['damping']:g} m," in text
    assert f"`adaptation` ({VALUES['adaptation']:g} 1/s) estimates" in text
    assert f"{FRICTION:g} 1/s is the rate of the damping" in text


def test_the_centroidal_law_shown_flies_as_its_comment_says(capsys):
    text = (DOCS / "centroidal_law.md").read_text("utf-8")
    code, *_ = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    names = {}
    exec(compile(code, "centroidal_law.md", "exec"), names)
    assert capsys.readouterr().out == code.rpartition("  # ")[2]
    assert names["controller"].par.delay_periods == 0


def test_a_scenario_tells_the_laws_its_clocks_and_its_delay():
    for law in (
        law for law in LAWS if {"delay", "delay_periods"} & set(LAWS[law].options())
    ):
        rates = {
            "rates": {"control": 100, "reference": 25},
            "delays": {"measurement": 0.03},
        }
        vehicle = {"plant": {"vehicle": "hummingbird_arm2_rotors"}, "duration": 1.0}
        par = scenario_from(
            {"name": "x", **rates, **vehicle, "controller": {"law": law}}
        ).controller.par
        assert par.delay_periods == 3
        assert getattr(par, "reference_period", 0.04) == 0.04
