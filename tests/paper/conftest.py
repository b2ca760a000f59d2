"""What several files of the paper's tests look at is flown once."""

from __future__ import annotations

import pytest

from skyarm.paper.campaign import Campaign, run_campaign

PLANTS = ("rigid_body", "mujoco")


@pytest.fixture(scope="session")
def campaign() -> Campaign:
    """Twenty episodes of 30 s as stated, thirty with settings that were found, on both plants, in this process."""
    return run_campaign(PLANTS, sensitivity=False, beyond=False)
