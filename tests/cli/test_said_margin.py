"""The delay margin is said where a controller is made, and warned of on standard error where it is short."""

from __future__ import annotations

import json

import pytest

from commanded import skyarm


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_a_flight_says_its_margin_when_it_is_asked():
    words = ("run", "case3", "--duration", "0.1", "--controller")
    assert "margin" not in (silent := skyarm(*words, "paper_pd")).out + silent.err
    done = skyarm(*words, "paper_pd", "--margin")
    assert "delay margin: decoupled_pd in hover bears 3.05 ms" in done.out
    assert done.err.count("\n") == 1
    assert "warning: decoupled_pd: delay margin: below one control period, 5 ms" in done.err
    found = json.loads((done := skyarm(*words, "paper_ct", "--margin", "--json")).out)
    # README: 33 ms
    assert found["delay_margin_s"] == pytest.approx(0.033, abs=1e-3)
    assert (found["delay_believed_s"], found["delay_margin_enough"], done.err) == (0.0, True, "")


@pytest.mark.parametrize(
    ("words", "said", "enough"),
    [
        (("decoupled_pd", "--vehicle", "pelican_arm2", "--rate", "50"), "decoupled_pd", False),
        (("paper_ct", "--vehicle", "hummingbird_arm2"), "not known: plant.vehicle = 'hummingbird_arm2'", None),
        (("paper_ct", "--vehicle", "hummingbird_arm2", "--rate", "333.3"), "not known: a rate of 333.3 Hz", None),
        (("case3",), "hybrid_computed_torque in hover bears 33 ms", True),
    ],
)
def test_a_controller_in_c_comes_with_its_margin(words, said, enough):
    done = skyarm("export-c", *words, "-o", "law.c")
    assert (done.code, said in done.out.splitlines()[1]) == (0, True), done.out
    assert ("warning" in done.err) == (enough is False)
    if enough is None:
        assert json.loads(skyarm("export-c", *words, "-o", "law.c", "--json").out)["delay_margin_s"] is None
