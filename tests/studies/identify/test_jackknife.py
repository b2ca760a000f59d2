"""Scores of blocks, of residuals of the fit without them: against fits in which each block is really left out."""

import numpy as np
import pytest

from skyarm.studies.identify.whitened_fit import jackknife_scores


@pytest.mark.parametrize("rows", [1, 3])
def test_scores_of_a_block_are_those_of_a_fit_without_it(rows):
    rng = np.random.default_rng(1)
    slope, error, blocks = rng.standard_normal((80, rows, 4)), rng.standard_normal((80, rows)), 8
    # one parameter that is moved in the first block alone as a rule
    slope[10:, :, 3] *= 0.2
    flat, wanted = slope.reshape(-1, 4), error.ravel()
    found = np.linalg.lstsq(flat, wanted, rcond=None)[0]
    curvature = np.linalg.inv(flat.T @ flat)
    scores = jackknife_scores(slope, (wanted - flat @ found).reshape(80, rows), curvature, blocks)
    part = np.repeat(np.arange(blocks), 10 * rows)
    for b in range(blocks):
        inside = part == b
        without = np.linalg.lstsq(flat[~inside], wanted[~inside], rcond=None)[0]
        assert scores[b] == pytest.approx(flat[inside].T @ (wanted[inside] - flat[inside] @ without))
        # what is left out: the shift of the parameters that the block makes
        assert curvature @ scores[b] == pytest.approx(found - without)


@pytest.mark.parametrize("units", [(1.0, 1e-9, 1e7), (1e4, 1e-6, 1e-9)])
def test_scores_do_not_hang_on_units(units):
    """Of an inertia in kg m^2 beside a time in s: the score in other units is that in the first over them."""
    rng, unit = np.random.default_rng(3), np.array(units)
    slope, error = rng.normal(size=(90, 2, 3)), rng.normal(size=(90, 2))
    slope[:, :, 2] += 30.0 * slope[:, :, 1]
    rows = slope.reshape(-1, 3)
    curvature = np.linalg.inv(rows.T @ rows)
    plain = jackknife_scores(slope, error, curvature, 9)
    other = jackknife_scores(slope / unit, error, curvature * np.outer(unit, unit), 9)
    assert other * unit == pytest.approx(plain, rel=1e-6)
