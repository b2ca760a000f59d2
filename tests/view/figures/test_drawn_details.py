"""Maps and bands as they are drawn: shares counted by hand, the line of half in its place, no band over a curve."""

from __future__ import annotations

import math

import numpy as np
import pytest
from matplotlib.collections import PolyCollection, QuadMesh
from matplotlib.contour import ContourSet

from logs_synthetic import WINDOWS, all_logs
from skyarm.studies.stability.basin import Basin
from skyarm.view.figures.paper_figures import JOINT_ERRORS, POSITION_ERRORS, TOOL_ERRORS, paper_figures
from skyarm.view.figures.study_figures import basin_figure

FLIGHTS, LIMIT = 10_000, 12.0


def of_half() -> Basin:
    """Flights over all tilts and rates of which those are caught that begin less than a right angle off."""
    rng = np.random.default_rng(5)
    tilt, rate = rng.uniform(0.0, math.pi, FLIGHTS), rng.uniform(0.0, LIMIT, FLIGHTS)
    caught = tilt < 0.5 * math.pi
    return Basin(
        controller="law",
        scenario="case",
        seed=0,
        tilt=tilt,
        rate=rate,
        offset=np.zeros(FLIGHTS),
        speed=np.zeros(FLIGHTS),
        caught=caught,
        returned=caught,
        status=np.where(caught, "completed", "fell"),
        rate_limit=LIMIT,
        offset_limit=0.0,
        speed_limit=0.0,
    )


def test_a_bin_has_the_share_of_its_own_flights_and_half_is_drawn_between_the_middles_of_bins():
    """Of six bins by tilt the first three are caught whole: between 75 and 105 degrees the share is half at 90."""
    found = of_half()
    (ax, *_) = basin_figure(found).axes
    mesh = next(each for each in ax.collections if isinstance(each, QuadMesh))
    shares = np.asarray(mesh.get_array()).reshape(mesh.get_coordinates().shape[0] - 1, -1)
    rates, tilts = shares.shape
    for i in range(rates):
        for j in range(tilts):
            inside = (found.rate >= LIMIT * i / rates) & (found.rate < LIMIT * (i + 1) / rates)
            inside &= (found.tilt >= math.pi * j / tilts) & (found.tilt < math.pi * (j + 1) / tilts)
            assert shares[i, j] == pytest.approx(found.caught[inside].mean(), abs=1e-12)
    (line,) = (each for each in ax.collections if isinstance(each, ContourSet))
    points = np.concatenate([path.vertices for path in line.get_paths()])
    assert np.allclose(points[:, 0], 90.0)
    # the middles of four bins by rate
    assert (points[:, 1].min(), points[:, 1].max()) == pytest.approx((LIMIT / 8.0, LIMIT * 7.0 / 8.0))


def test_the_range_of_a_hold_hides_no_curve():
    found = 0
    for figure in paper_figures(all_logs()["rigid_body"], WINDOWS).values():
        for ax in figure.axes:
            bands = [each.get_zorder() for each in ax.collections if isinstance(each, PolyCollection)]
            curves = [each.get_zorder() for each in ax.get_lines() if not each.get_label().startswith("_")]
            assert not bands or max(bands) < min(curves)
            found += len(bands)
    assert found > 40


def test_an_error_is_the_measured_value_less_the_held_one():
    """The synthetic flight is off by (0.03, 0, -0.04) m, its tip by 0.01 m along y, its first joint by -0.02 rad."""
    log = all_logs()["rigid_body"]["case1"]["CT"]
    drawn = [*POSITION_ERRORS, *TOOL_ERRORS[:2], JOINT_ERRORS[0]]
    for quantity, off in zip(drawn, (0.03, 0.0, -0.04, 0.0, 0.01, -0.02), strict=True):
        assert quantity.of(log) == pytest.approx(np.full(log.time.size, off), abs=1e-12), quantity.label
