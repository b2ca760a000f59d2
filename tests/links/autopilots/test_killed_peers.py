"""Programs of autopilots that are killed, frozen or asked to end in a flight: an end in
one line, and nothing left.
"""

from __future__ import annotations

import os

import pytest
from kill_peers import kill_peers


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["px4", "ardupilot", "betaflight"])
def test_a_program_that_dies_ends_the_flight_and_leaves_nothing(name: str) -> None:
    variable = f"SKYARM_{name.upper()}"
    if not os.environ.get(variable):
        pytest.skip(f"{variable} does not name the program")
    found = kill_peers(name, 3)
    assert found["kills"] == 3
    assert found["faults"] == []
