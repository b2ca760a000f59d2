"""A law in one process, simulator and a real PX4 in another: it flies its circle, and a
cut link loses no vehicle.
"""

import os

import pytest
from beside_px4 import fly_beside
from cut_links import cut_links

pytestmark = [
    pytest.mark.thorough,
    pytest.mark.skipif(
        not os.environ.get("SKYARM_PX4"),
        reason="SKYARM_PX4 does not name PX4's program",
    ),
]


@pytest.mark.parametrize("law", ['preset = "paper_ct"', 'law = "centroidal"'])
def test_a_law_flies_its_circle_as_in_the_simulator(law):
    found = fly_beside(law)
    assert found["status"] == "completed"
    assert found["truth_mm"] < 1.3 * found["own_estimate_mm"]
    assert found["delay_p99_ms"] < 10.0


def test_a_cut_link_loses_no_vehicle():
    found = cut_links(3)
    assert found["cuts"] == 3
    assert found["status"] == "hovers"
    assert found["left"] == []
    assert found["excursion_m"][1] < 2.0
    assert set(found["codes"]) <= {3}
