"""The paper's vehicle picks up a load of which nobody told it, carries it and lets it
go.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import skyarm
from skyarm.control.onboard.export_c import export_c
from skyarm.control.safety import with_safety_layer
from skyarm.records.plain import plain
from skyarm.records.restore import restore
from skyarm.scenario.numbers import number_at, with_numbers
from skyarm.scenario.scenario_file import scenario_from
from skyarm.simulate.loop import run_in_python

MASS, PICK, DROP = 0.15, 0.505, 2.015
"""kg; s, in no period of the published reference."""

DOCUMENT = {
    "schema": 1,
    "name": "carry",
    "duration": 2.6,
    "plant": {"vehicle": "hummingbird_arm2_rotors"},
    "model": {"vehicle": "hummingbird_arm2"},
    "controller": {"law": "centroidal", "mode": "tip", "load": 0.3},
    "reference": {
        "base": {"kind": "signals", "z": 1.0},
        "joints": [0.5, -1.0],
        "load": {"kind": "windowed", "signal": 1.0, "start": PICK, "stop": DROP},
    },
    "payloads": [{"name": "box", "mass": MASS, "pick": PICK, "drop": DROP}],
}


@pytest.fixture(scope="module")
def scenario():
    return scenario_from(DOCUMENT)


@pytest.fixture(scope="module")
def log(scenario):
    return skyarm.run(scenario)


def error(log, start, stop):
    """Largest distance of the tip from its reference in some time, m."""
    inside = (log.time >= start) & (log.time < stop)
    return np.linalg.norm((log.tip - log.tip_reference)[inside], axis=1).max()


def test_the_mass_is_known_after_a_second_and_gone_when_the_load_is(log):
    assert log.status == "completed"
    after = (log.time > PICK + 1.0) & (log.time < DROP - 0.01)
    assert log.load_mass_found[after] == pytest.approx(MASS, rel=0.02)
    assert np.abs(log.load_place_found[after]).max() < 2e-3
    for held in (log.time < PICK, log.time >= DROP):
        assert not log.load_mass_found[held].any()
    assert error(log, PICK + 1.0, DROP) < 2e-3


def test_the_tip_hardly_jumps_when_the_load_goes(scenario, log):
    plain_law = scenario_from(
        DOCUMENT | {"controller": DOCUMENT["controller"] | {"load": 0.0}}
    )
    without = skyarm.run(plain_law)
    released = [error(each, DROP, 2.6) for each in (log, without)]
    assert released[0] < 5e-3
    assert released[1] > 30e-3
    assert not without.load_mass_found.size


@pytest.mark.thorough
def test_every_engine_learns_the_same_and_layers_hide_nothing(scenario, log):
    short = dataclasses.replace(scenario, duration=0.6)
    assert np.array_equal(
        run_in_python(short).load_mass_found, log.load_mass_found[:120]
    )
    guarded = dataclasses.replace(
        short, controller=with_safety_layer(scenario.controller)
    )
    assert skyarm.run(guarded).load_mass_found[-1] == pytest.approx(
        log.load_mass_found[119], rel=0.2
    )


def test_files_keep_what_was_learned(log, tmp_path):
    for name in ("x.npz", "x.mcap"):
        kept = skyarm.load_log(skyarm.save_log(log, tmp_path / name))
        assert np.array_equal(kept.load_mass_found, log.load_mass_found)
        assert np.array_equal(kept.load_place_found, log.load_place_found)
    head = skyarm.save_log(log, tmp_path / "x.csv").read_text().split("\n", 1)[0]
    assert (
        "load_mass_found [kg],load_place_found_x [m],load_place_found_y"
        " [m],load_place_found_z [m]" in head
    )


def test_the_load_of_a_reference_is_kept_moved_and_named(scenario):
    trajectory = scenario.reference
    assert restore(plain(trajectory)) == trajectory
    assert trajectory.shifted(1.0).at(DROP + 0.9).load == (1.0,)
    assert trajectory.shifted(1.0).at(PICK + 0.9).load == (0.0,)
    assert {PICK, DROP} <= set(trajectory.switch_times())
    assert dataclasses.replace(trajectory, load=None).at(1.0).load == ()
    with pytest.raises(ValueError, match="two trajectories that each have a load"):
        trajectory + trajectory
    assert (
        trajectory + dataclasses.replace(trajectory, load=None)
    ).load == trajectory.load
    changed = with_numbers(
        scenario, {"reference.load.stop": 1.5, "controller.parts.load.size": 0.03}
    )
    assert changed.reference.at(1.6).load == (0.0,)
    assert number_at(changed, "controller.parts.load.size") == 0.03


@pytest.mark.parametrize("load", ["closed", {"kind": "gripper"}, [True]])
def test_a_load_that_is_no_signal_is_refused_in_one_line(load):
    document = DOCUMENT | {"reference": DOCUMENT["reference"] | {"load": load}}
    with pytest.raises(ValueError, match=r"reference\.load") as refusal:
        scenario_from(document)
    assert "\n" not in str(refusal.value)


def test_a_law_that_is_never_told_of_a_load_is_refused_in_one_line():
    reference = {
        key: value for key, value in DOCUMENT["reference"].items() if key != "load"
    }
    with pytest.raises(
        ValueError, match=r"controller\.load = 0\.3: must be 0 without reference\.load"
    ) as refusal:
        scenario_from(DOCUMENT | {"reference": reference})
    assert "\n" not in str(refusal.value)
    without = DOCUMENT["controller"] | {"load": 0.0}
    assert (
        scenario_from(
            DOCUMENT | {"reference": reference, "controller": without}
        ).controller.par.parts.adaptation.load
        is not None
    )


def test_exported_c_is_told_of_the_load(scenario):
    found = export_c(scenario.controller, name="law", period=0.005)
    assert "double load[1];" in found.text
    assert any(name.endswith("load_limit") for name in found.parameters)
    assert "push[" not in found.text
