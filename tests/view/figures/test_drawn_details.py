"""Errors as they are drawn: the measured value less the held one."""

from __future__ import annotations

import numpy as np
import pytest

from skyarm.view.figures.paper_figures import JOINT_ERRORS, POSITION_ERRORS, TOOL_ERRORS
from support.logs import all_logs


def test_an_error_is_the_measured_value_less_the_held_one():
    """The synthetic flight is off by (0.03, 0, -0.04) m, its tip by 0.01 m along y, its
    first joint by -0.02 rad.
    """
    log = all_logs()["rigid_body"]["case1"]["CT"]
    drawn = [*POSITION_ERRORS, *TOOL_ERRORS[:2], JOINT_ERRORS[0]]
    for quantity, off in zip(drawn, (0.03, 0.0, -0.04, 0.0, 0.01, -0.02), strict=True):
        assert quantity.of(log) == pytest.approx(
            np.full(log.time.size, off), abs=1e-12
        ), quantity.label
