"""What the page on the paper says of its scenarios is what is flown."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import skyarm

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGE = "\n".join(
    (DOCS / name).read_text("utf-8") for name in ("the_paper.md", "data/the_paper.md")
)
ROWS = dict(re.findall(r"^\| ([^|]+?) \| ([^|]+?) \| [^|]+ \|$", PAGE, re.M))
CASES = ("case1", "case2", "case2_gust", "case3", "case3_wind")


@pytest.mark.parametrize("case", CASES)
def test_the_assumptions_of_the_page_are_those_of_the_scenario(case: str) -> None:
    scenario = skyarm.load_scenario(case, controller="paper_ct")
    truth, belief, rates = scenario.plant, scenario.controller.par.model, scenario.rates
    assert f"{float(truth.vehicle.mass):.5f} kg in all" in ROWS["base of the plant"]
    assert f"{float(belief.vehicle.mass):.3f} kg in all" in ROWS["base of the model"]
    assert ROWS["gravity"] == f"plant {truth.gravity:g}, model {belief.gravity:g} m/s^2"
    assert ROWS["rates"].startswith(
        f"plant {rates.physics / 1000:g} kHz, law {rates.control} Hz, reference"
        f" {rates.reference}"
    )
    for link in truth.vehicle.links:
        assert ROWS["joint damping"].startswith(
            f"{float(link.joint.damping):g} N m s/rad"
        )
        assert (
            ROWS["torque limit of the joints"]
            == f"{float(link.joint.effort_limit):g} N m"
        )
    rotor = truth.vehicle.rotors[0]
    up, down = (
        1000 * float(rotor.time_constant_up),
        1000 * float(rotor.time_constant_down),
    )
    assert f"{up:g} ms up and {down:g} ms down" in ROWS["motors, lag"]
    assert scenario.delays == skyarm.Delays()


def test_the_winds_of_the_page_are_those_of_the_scenarios() -> None:
    wind, gust = (
        skyarm.load_scenario(case).wind for case in ("case3_wind", "case2_gust")
    )
    assert (
        ROWS['"2 m/s wind", Case 3']
        == f"{float(wind.force_W.x):g} N of force and {float(wind.air_velocity_W.x):g}"
        " m/s of air speed"
    )
    assert ROWS['"2 m/s gust", Case 2'].startswith(
        f"{float(gust.gust.peak.x):g} N of force, no air speed"
    )
    assert float(gust.air_velocity_W.x) == 0.0
    assert set(re.findall(r"^\| `(case\w+)` \|", PAGE, re.M)) == set(CASES)
