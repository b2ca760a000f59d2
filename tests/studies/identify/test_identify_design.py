"""``skyarm identify --design VEHICLE``: options that do not belong together, and a scenario that flies."""

from __future__ import annotations

import dataclasses
import math
import re
from pathlib import Path

import pytest

from skyarm.records.units import units
from skyarm.studies.identify.design import DesignLimits
from support.commands import refused, skyarm

pytest.importorskip("scipy", reason="needs the extra 'identify'")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--box", "1"), "--box: must be left out without --design"),
        (("--design", "hummingbird", "flight.csv"), "FLIGHT: must be left out with --design"),
        (("--design", "hummingbird", "--lags"), "--lags: must be left out with --design"),
        (("--design", "hummingbird", "--tilt", "70"), "--tilt = 70: must be from 2 to 60"),
        (("--design", "hummingbird", "--seconds", "5"), "--seconds = 5: must be from 10 to 600"),
        (("--design", "hummingbird", "--box", "0"), "--box = 0.0: must be above 0"),
        (("--design", "no_such_vehicle"), "no_such_vehicle"),
        ((), "FLIGHT: is missing: must be one log or more, or --design VEHICLE"),
    ],
)
def test_what_is_refused(words, message):
    refused(skyarm("identify", *words), message)


def test_the_help_has_each_limit_with_its_unit_and_default():
    lines = skyarm("identify", "design", "--help", columns=100).out.splitlines()
    for each in dataclasses.fields(DesignLimits):
        (line,) = (line for line in lines if line.startswith(f"  --{each.name} "))
        unit, usual = units(DesignLimits)[each.name], each.default
        shown, usual = ("deg", math.degrees(usual)) if unit.unit == "rad" else (unit.unit, usual)
        assert line.endswith(f"{shown}, {unit.meaning}  [default: {usual:g}]")


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore::skyarm.scenario.without_effect.WithoutEffectWarning")  # its inertial unit
def test_a_design_is_a_scenario_that_flies(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = skyarm("identify", "--design", "hummingbird", "--seconds", "20", "--box", "1", "-o", "excite.toml")
    assert done.code == 0
    assert "sharper by" in done.out
    assert skyarm("run", "excite.toml").code == 0


NUMBER = re.compile(r"(?<![\w.])\d[\d.]*(?:e-?\d+)?(?![\w.])")


@pytest.mark.thorough
def test_the_design_of_the_page_prints_what_it_shows(tmp_path, monkeypatch):
    """The command of docs/identification.md, which takes a minute."""
    monkeypatch.chdir(tmp_path)
    page = (Path(__file__).parents[3] / "docs" / "identification.md").read_text("utf-8")
    block = r"```sh\n(skyarm identify design [^\n]*)\n```\n\n<!-- [^\n]* -->\n```text\n(.*?)```"
    ((command, shown),) = re.findall(block, page, re.S)
    done = skyarm(*command.split()[1:])
    assert done.code == 0
    # the last digits of a design depend on how its search is spread over the cores
    printed = {NUMBER.sub("#", " ".join(line.split())): line for line in done.out.splitlines()}
    for line in filter(None, shown.splitlines()):
        same = printed[NUMBER.sub("#", " ".join(line.split()))]
        pairs = zip(NUMBER.findall(line), NUMBER.findall(same), strict=True)
        assert all(float(a) == pytest.approx(float(b), rel=0.2) for a, b in pairs), (line, same)
