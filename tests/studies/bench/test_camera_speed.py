"""Benchmark of pictures: all see the same scene."""

from __future__ import annotations

import camera_speed as room
import numpy as np


def test_the_pictures_are_of_the_same_scene():
    one = room.Scene()
    ours, theirs = one.ours(2), one.theirs()
    np.testing.assert_array_equal(ours[0], ours[1])
    met = theirs >= 0.0
    np.testing.assert_array_equal(np.isfinite(ours[0]), met)
    np.testing.assert_allclose(ours[0][met], theirs[met], rtol=0, atol=1e-9)
    assert 0.3 < met.mean() < 1.0


def test_contenders_make_pictures(capsys):
    room.main(1, 2)
    assert "skyarm 2" in capsys.readouterr().out
