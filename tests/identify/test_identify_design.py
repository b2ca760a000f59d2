"""``skyarm identify --design VEHICLE``: options that do not belong together, and a
scenario that flies.
"""

from __future__ import annotations

import dataclasses
import math
import re
from pathlib import Path

import numpy as np
import pytest

from skyarm.flight_data.own_log import measured_flight
from skyarm.identify import window_errors
from skyarm.identify.design import DesignLimits
from skyarm.identify.identify_windows import search_of
from skyarm.records.units import units
from skyarm.scenario.scenario_file import load_scenario
from skyarm.simulate import run
from skyarm.vehicle.vehicle_files import load_vehicle
from support.commands import refused, skyarm

pytest.importorskip("scipy", reason="needs the extra 'identify'")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--box", "1"), "--box: must be left out without --design"),
        (
            ("--design", "hummingbird", "flight.csv"),
            "FLIGHT: must be left out with --design",
        ),
        (
            ("--design", "hummingbird", "--lags"),
            "--lags: must be left out with --design",
        ),
        (
            ("--design", "hummingbird", "--tilt", "70"),
            "--tilt = 70: must be from 2 to 60",
        ),
        (
            ("--design", "hummingbird", "--seconds", "5"),
            "--seconds = 5: must be from 10 to 600",
        ),
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
        shown, usual = (
            ("deg", math.degrees(usual)) if unit.unit == "rad" else (unit.unit, usual)
        )
        assert line.endswith(f"{shown}, {unit.meaning}  [default: {usual}]")


@pytest.mark.thorough
# its inertial unit
@pytest.mark.filterwarnings(
    "ignore::skyarm.scenario.without_effect.WithoutEffectWarning"
)
def test_a_design_is_a_scenario_that_flies(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = skyarm(
        "identify",
        "--design",
        "hummingbird",
        "--seconds",
        "20",
        "--box",
        "1",
        "-o",
        "excite.toml",
    )
    assert done.code == 0
    assert "sharper by" in done.out
    assert skyarm("run", "excite.toml").code == 0


def test_bits_of_windows_do_not_depend_on_the_compiler_s_effort_or_on_threads(
    tmp_path, monkeypatch
):
    """A design decides by them: contractions, which LLVM makes by its effort, led to
    another one.
    """
    monkeypatch.setenv("SKYARM_CACHE", str(tmp_path))
    log = run(load_scenario("hover_swing", duration=3.0))
    search = search_of(
        [measured_flight(log, Path("hover.npz"))],
        load_vehicle("hummingbird_arm2_rotors"),
    )
    found = []
    for effort, threads in (("0", 1), ("1", 1), ("1", 3)):
        monkeypatch.setenv("SKYARM_EFFORT", effort)
        monkeypatch.setattr(window_errors, "cores", lambda threads=threads: threads)
        errors = search.errors(search.first, 8)
        errors.take_samples(search.begin)
        found.append(errors.errors_at(search.begin, errors.first_states())[0])
    np.testing.assert_array_equal(found[1], found[0])
    np.testing.assert_array_equal(found[2], found[0])
    assert np.ptp(found[0]) > 0.1


@pytest.mark.thorough
def test_the_design_of_the_page_prints_what_it_shows(tmp_path, monkeypatch):
    """The command of docs/identification.md, which takes a minute."""
    monkeypatch.chdir(tmp_path)
    page = (Path(__file__).parents[2] / "docs" / "identification.md").read_text("utf-8")
    block = (
        r"```sh\n(skyarm identify design [^\n]*)\n```\n\n<!-- [^\n]*"
        r" -->\n```text\n(.*?)```"
    )
    ((command, shown),) = re.findall(block, page, re.S)
    done = skyarm(*command.split()[1:])
    assert done.code == 0
    printed = [" ".join(line.split()) for line in done.out.splitlines()]
    for line in filter(None, shown.splitlines()):
        assert line == "..." or " ".join(line.split()) in printed, line
