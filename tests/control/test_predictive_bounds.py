"""The whole numbers of the predictive law: the ends of their ranges are taken, one beyond is refused by name."""

from __future__ import annotations

import pytest

from flown import MODEL
from skyarm.control.controller import ControllerError
from skyarm.control.laws.predictive.law import make_predictive_controller
from skyarm.scenario.scenario_file import load_scenario


@pytest.mark.parametrize(
    ("name", "least", "most", "others"),
    [("stages", 2, 200, {"every": 1}), ("every", 1, 199, {"stages": 200}), ("delay_periods", 0, 100, {})],
)
def test_both_ends_of_a_range_are_taken_and_no_more(name, least, most, others):
    for value in (least, most):
        assert getattr(make_predictive_controller(MODEL, **others, **{name: value}).par, name) == value
    for value in (least - 1, most + 1, True, float(least), "2", None):
        with pytest.raises(ControllerError, match=rf"^controller\.{name} = "):
            make_predictive_controller(MODEL, **others, **{name: value})


def test_the_horizon_is_a_time_from_50_ms_to_5_s():
    for value in (0.05, 5.0, 1):
        par = make_predictive_controller(MODEL, horizon=value).par
        assert (par.horizon, par.every) == (float(value), 2)
    for value in (0.0499, 5.001, True, "1", float("nan")):
        with pytest.raises(ControllerError, match=r"^controller\.horizon = .*: must be a number of s from 0\.05 to 5$"):
            make_predictive_controller(MODEL, horizon=value)


def test_the_preview_is_samples_or_a_trajectory():
    trajectory = load_scenario("case1").trajectory
    assert make_predictive_controller(MODEL, preview=trajectory).par.preview is trajectory
    assert make_predictive_controller(MODEL, preview="samples").par.preview == "samples"
    for value in ("sample", "", None, 3):
        with pytest.raises(ControllerError, match=r"^controller\.preview = .*: must be 'samples' or a Trajectory$"):
            make_predictive_controller(MODEL, preview=value)
