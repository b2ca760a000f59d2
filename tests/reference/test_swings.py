"""Given times between which a smooth motion would swing far away are refused, and
ordinary ones are not.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from skyarm.reference.reference_tables import reference_from
from skyarm.reference.signals import signal_from
from skyarm.reference.task_records import Setting


def swing(times, values):
    """By SciPy: how far a natural spline of seventh degree at rest at its ends leaves
    the range of its values.
    """
    rest = [(k, 0.0) for k in (1, 2, 3)]
    spline = make_interp_spline(times, values, k=7, bc_type=(rest, rest))
    found = spline(
        np.concatenate([np.linspace(a, b, 200) for a, b in itertools.pairwise(times)])
    )
    return max(found.max() - max(values), min(values) - found.min()) / (
        max(values) - min(values)
    )


TIMES = [
    ([0.0, 0.5, 60.0], [0.0, 0.1, 1.0]),
    ([0.0, 1.0, 30.0], [0.0, 0.1, 1.0]),
    ([0.0, 10.0, 10.1, 20.0], [0.0, 1.0, 1.01, 2.0]),
    ([0.0, 30.0, 30.1, 60.0, 60.1, 90.0], [0.0, 1.0, 1.0, 0.0, 0.0, 1.0]),
    ([0.0, 0.7, 1.9, 2.3, 4.0], [0.0, 1.0, -0.5, 2.0, 0.3]),
    ([0.0, 4.0, 6.0], [0.0, 0.1, 1.0]),
    ([0.0, 1.0, 2.0, 3.0], [0.0, 1.0, 1.0, 0.0]),
]


@pytest.mark.parametrize(("times", "values"), TIMES)
def test_a_spline_is_refused_where_scipys_leaves_its_range_by_more_than_the_range(
    times, values
):
    table = {"kind": "spline", "times": times, "values": values}
    if swing(times, values) > 1.0:
        with pytest.raises(
            ValueError,
            match=r"^s\.times: the smooth motion through the values swings .* at .* s",
        ):
            signal_from(table, "s")
    else:
        signal_from(table, "s")


def test_both_happen():
    found = [swing(*each) > 1.0 for each in TIMES]
    assert True in found
    assert False in found


def test_waypoints_with_given_times_and_samples_of_a_file_are_looked_at_too(tmp_path):
    points = {
        "kind": "waypoints",
        "points": [[0, 0, 1], [0.1, 0, 1], [1, 0, 1]],
        "times": [0.0, 0.5, 60.0],
    }
    with pytest.raises(ValueError, match=r"^reference\.base\.times: the smooth motion"):
        reference_from({"base": points}, 0, "reference", Setting(duration=60.0))
    assert reference_from(
        {"base": {k: v for k, v in points.items() if k != "times"}},
        0,
        "reference",
        Setting(duration=60.0),
    )
    (tmp_path / "path.csv").write_text(
        "time,x,y,z\n0,0,0,1\n0.5,0.1,0,1\n60,1,0,1\n", "utf-8"
    )
    table = {"kind": "samples", "file": str(tmp_path / "path.csv")}
    with pytest.raises(ValueError, match=r"^s\.file: x: the smooth motion"):
        signal_from(table | {"column": "x"}, "s")
