"""The delay margin is said where a controller is made, and warned of on standard error where it is short."""

from __future__ import annotations

import json

import pytest

from commanded import skyarm
from skyarm.scenario.scenario_file import load_scenario
from skyarm.studies.stability.hover_delay import hover_delay


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_a_flight_says_its_margin_when_it_is_asked():
    words = ("run", "case3", "--duration", "0.1", "--controller", "paper_pd")
    assert "margin" not in (silent := skyarm(*words)).out + silent.err
    done = skyarm(*words, "--margin", "--json")
    found = json.loads(done.out)
    planned = load_scenario("case3", controller="paper_pd")
    assert found["delay_margin_s"] == pytest.approx(hover_delay(planned).margin)
    assert (found["delay_believed_s"], found["delay_margin_enough"]) == (0.0, False)
    assert done.err.count("\n") == 1
    assert "warning: decoupled_pd: delay margin: below one control period, 5 ms" in done.err


@pytest.mark.parametrize(
    ("words", "said", "enough"),
    [
        (("decoupled_pd", "--vehicle", "pelican_arm2", "--rate", "50"), "decoupled_pd", False),
        (("paper_ct", "--vehicle", "hummingbird_arm2"), "hybrid_computed_torque in hover bears", None),
        (("paper_ct", "--vehicle", "hummingbird_arm2", "--rate", "333.3"), "not known: a rate of 333.3 Hz", None),
    ],
)
def test_a_controller_in_c_comes_with_its_margin(words, said, enough):
    done = skyarm("export", *words, "--to", "c", "-o", "law.c")
    assert (done.code, said in done.out.splitlines()[1]) == (0, True), done.out
    assert ("warning" in done.err) == (enough is False)
