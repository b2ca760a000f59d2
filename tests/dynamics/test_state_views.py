"""Roll, pitch and yaw of a state, against SciPy's rotations."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skyarm.dynamics.state import example_state


@pytest.mark.parametrize("seed", range(5))
def test_replaced_angles_are_those_of_scipy_and_the_others_stay(seed: int) -> None:
    rng = np.random.default_rng(seed)
    yaw, roll, other = rng.uniform(-3.0, 3.0, 3)
    pitch = rng.uniform(-1.5, 1.5)
    names = ("roll", "pitch", "yaw")
    state = example_state(2, 4).with_views(
        dict(zip(names, (roll, pitch, yaw), strict=True))
    )
    turned = state.with_views({"roll": other})
    for found, angles in ((state, (yaw, pitch, roll)), (turned, (yaw, pitch, other))):
        matrix = Rotation.from_euler("ZYX", angles).as_matrix()
        rows = [found.rotation.column(i) for i in range(3)]
        np.testing.assert_allclose(np.transpose(rows), matrix, atol=1e-12)
        read = [found.number_of_view(name) for name in names]
        np.testing.assert_allclose(read, angles[::-1], atol=1e-12)
