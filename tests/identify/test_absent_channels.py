"""What channels that a flight lacks cost: intervals with them, as a flight that holds
them gives.
"""

import dataclasses

import numpy as np
import pytest

from skyarm.identify import identify_windows
from skyarm.identify.identified_report import _absent_line
from skyarm.identify.identify_windows import costs_of_absent
from skyarm.identify.unknowns import unknowns_of
from skyarm.identify.window_errors import WindowErrors
from skyarm.identify.window_fit import fit_windows
from skyarm.identify.windows import ClockedWindows, on_clock
from support.flights import GRAVITY, NOISE, ONE, QUAD, STEP, flown, measured

pytest.importorskip("scipy")

SEARCHED = (
    "rotors.thrust_coefficient",
    "base.second_moment.x",
    "base.com.x",
    "base.com.z",
    "place.z",
    "offset.x",
)


def fitted(vehicle, driven, without=()):
    """Errors and fit of a few numbers to twenty windows of 60 ms, near the truth, under
    a noise that is stated.
    """
    flight = measured(flown(vehicle, 2.0), without=("velocity", *without))
    windows = ClockedWindows([on_clock(flight, vehicle, STEP)], vehicle, 0.06, 20)
    every = unknowns_of(
        vehicle,
        curve=False,
        velocity=True,
        voltage=False,
        driven=driven,
        servoed=[False] * vehicle.n,
    )
    errors = WindowErrors(
        windows,
        vehicle,
        [each for each in every if each.name in SEARCHED],
        {},
        driven,
        [False] * vehicle.n,
        GRAVITY,
    )
    found = fit_windows(
        errors, np.array([each.begin for each in errors.unknowns]), turns=1
    )
    noise = np.array([[NOISE[name] for name, _ in errors.rows]])
    return errors, dataclasses.replace(found, noise=noise, spread=1e-2 * errors.push)


def widths(errors, fit):
    """Deviations (P,) by the whole matrix of numbers and free numbers of all windows,
    without an elimination.
    """
    normal = errors.normal(fit.values, fit.states, fit.noise)[2]
    loose, prior = (
        errors.loose.copy(),
        np.array([each.spread for each in errors.unknowns]),
    )
    loose[errors.wrench] = fit.spread
    count, x, size = normal.mixed.shape
    whole = np.zeros((count * x + size, count * x + size))
    whole[count * x :, count * x :] = normal.common.sum(axis=0) + np.diag(prior**-2.0)
    for i in range(count):
        own = slice(i * x, i * x + x)
        whole[own, own] = normal.own[i] + np.diag(loose**-2.0)
        whole[own, count * x :], whole[count * x :, own] = (
            normal.mixed[i],
            normal.mixed[i].T,
        )
    scale = np.sqrt(np.diag(whole))
    inverse = np.linalg.inv(whole / np.outer(scale, scale))
    return (np.sqrt(np.diag(inverse)) / scale)[count * x :]


@pytest.mark.parametrize(
    ("vehicle", "driven", "absent", "channel"),
    [
        (QUAD, [], ("position", "quaternion"), "pose"),
        pytest.param(QUAD, [], ("position",), "position", marks=pytest.mark.thorough),
        (ONE, [True], ("joint_efforts",), "joint_efforts"),
    ],
    ids=["pose", "position", "efforts"],
)
def test_an_absent_channel_costs_what_a_flight_with_it_gains(
    vehicle, driven, absent, channel, monkeypatch
):
    monkeypatch.setattr(
        identify_windows,
        "NOISE",
        {name: NOISE[name] for name in ("position", "quaternion")},
    )
    monkeypatch.setattr(identify_windows, "PERIOD", STEP)
    whole, expected = fitted(vehicle, driven)
    assert costs_of_absent(whole, expected, np.eye(len(SEARCHED))) == {}
    errors, fit = fitted(
        vehicle, [False] * vehicle.n if "joint_efforts" in absent else driven, absent
    )
    costs = costs_of_absent(errors, fit, np.eye(len(errors.names)))
    assert list(costs) == [channel]
    kept = [whole.names.index(name) for name in errors.names]
    assert costs[channel] == pytest.approx(
        widths(errors, fit) / widths(whole, expected)[kept], rel=0.1
    )
    assert costs[channel].max() > 1.12
    assert costs[channel].min() > 1.0 - 1e-6


def test_a_report_names_what_an_absent_channel_blurs_most():
    costs = {f"n{i}": float(i) for i in range(1, 8)}
    told = _absent_line("pose", costs)
    named = "n7 7, n6 6, n5 5, n4 4 and 2 more"
    assert (
        told == "pose: not logged; intervals are wider than with one of motion capture,"
        f" times about: {named}"
    )
    assert _absent_line("pose", {"a": 1.4}).startswith(
        "pose: not logged; no interval would be narrower by more"
    )
