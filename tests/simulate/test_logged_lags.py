"""The lag that the centroidal law finds while flying stands in the log; of other laws
there is nothing of it.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import skyarm
from skyarm.control.law_estimates import lags_found
from skyarm.control.safety import with_safety_layer
from skyarm.log.flight_summary import facts, sentences
from skyarm.simulate.loop import run_in_python
from skyarm.studies.trial.trial import NOISE

LATE = 0.02
"""s, of the commands, of which nobody told the law."""


@pytest.fixture(scope="module")
def scenario():
    planned = skyarm.load_scenario("case3", controller="centroidal_tip", duration=0.6)
    return dataclasses.replace(planned, noise=NOISE, delays=skyarm.Delays(command=LATE))


@pytest.fixture(scope="module")
def log(scenario):
    return skyarm.run(scenario)


def test_what_is_found_is_how_late_the_commands_are(log):
    assert log.lag_found.shape == (len(log.time), 2)
    # nothing is known at first; after half a second the rotors' lag is within half a
    # step of the bank, the joints', whose motion is a smaller part of their noise,
    # within one and a half
    assert log.lag_found[0] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert log.lag_found[-1][0] == pytest.approx(LATE, abs=0.0025)
    assert log.lag_found[-1][1] == pytest.approx(LATE, abs=0.0075)


@pytest.mark.thorough
def test_it_is_found_under_guard_as_well(scenario):
    assert lags_found(with_safety_layer(scenario.controller).memory) == (0.0, 0.0)
    assert lags_found(skyarm.load_scenario("case3").controller.memory) == ()


@pytest.mark.thorough
def test_it_is_what_the_law_holds_until_another_takes_over(scenario, log):
    change = skyarm.Change(at=0.1, path="controller.law", value="indi")
    session = skyarm.Session(
        dataclasses.replace(scenario, duration=0.15, changes=(change,))
    )
    for _ in range(19):
        session.step()
    # the lag that the last period answered
    assert session.now.agent.memory.parts.lag.found == tuple(log.lag_found[18])
    while session.step():
        pass
    found = session.log.lag_found
    assert found.shape == (30, 2)
    assert np.array_equal(found[:20], log.lag_found[:20])
    assert found[19].any()
    # a law that finds none leaves none, and no lag of 0 s
    assert np.isnan(found[20:]).all()
    assert facts(session.log)["lag_found_s"] == pytest.approx(found[19])


def test_a_law_that_has_not_flown_yet_has_found_no_lag():
    session = skyarm.Session(skyarm.load_scenario("case1", duration=0.2))
    for _ in range(5):
        session.step()
    session.change({"controller.law": "centroidal"})
    assert np.isnan(session.log.lag_found).all()
    assert "lag_found_s" not in facts(session.log)


@pytest.mark.thorough
def test_it_is_the_same_in_every_engine_and_under_guard(scenario, log):
    short = dataclasses.replace(scenario, duration=0.2)
    assert np.array_equal(run_in_python(short).lag_found, log.lag_found[:40])
    guarded = dataclasses.replace(
        short, controller=with_safety_layer(scenario.controller)
    )
    assert guarded.controller.memory.inner.parts.lag.found == (0.0, 0.0)
    assert skyarm.run(guarded).lag_found.shape == (40, 2)


def test_files_keep_it_under_names_and_a_law_without_it_leaves_it_out(log, tmp_path):
    for name in ("x.npz", "x.mcap"):
        skyarm.save_log(log, tmp_path / name)
        assert np.array_equal(skyarm.load_log(tmp_path / name).lag_found, log.lag_found)
    head = skyarm.save_log(log, tmp_path / "x.csv").read_text().split("\n", 1)[0]
    assert head.endswith("lag_found_rotors [s],lag_found_joints [s]")
    other = skyarm.run(skyarm.load_scenario("case3", duration=0.05))
    assert other.lag_found.shape == (0, 0)
    assert "lag_found" not in other.arrays()


@pytest.mark.parametrize(
    ("found", "words"),
    [
        ((0.0, 0.0), None),
        ((4e-5, 2e-3), "joints 2.0 ms"),
        ((6e-5, 0.0), "rotors 0.1 ms"),
    ],
)
def test_a_lag_that_would_read_zero_is_not_told(found, words):
    lines = [
        line
        for line in sentences({"lag_found_s": np.array(found)})
        if line.startswith("lag found")
    ]
    assert lines == (
        []
        if words is None
        else [f"lag found at the end, beyond the law's nominal: {words}"]
    )
