"""Covariance of the filter's error: prediction, and update by one scalar at a time, over scalars.

The error has fifteen components: position (m), velocity (m/s), attitude (rotation vector, rad, world axes: the truth is
exp(error) times the estimate), bias of the gyroscope (rad/s) and of the accelerometer (m/s^2), base axes; three more
where the force is modelled: what the model lacks (m/s^2, world axes). A covariance is the lower triangle, row by row:
P[i][j] for j <= i.

Sources: Sola 2017, "Quaternion kinematics for the error-state Kalman filter", section 7 (errors in world axes);
Bierman 1977 (sequential update by scalars whose noises are independent).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from skyarm.algebra import Mat3, Vec3
from skyarm.scalars import add, data, divide, mul, neg, sub, where

POSITION, VELOCITY, ATTITUDE, GYRO_BIAS, ACCELEROMETER_BIAS, PUSH = 0, 3, 6, 9, 12, 15
"""First component of each part of the error."""

Covariance = tuple[tuple[Any, ...], ...]
Row = Mapping[int, Any]
"""Entries of a row of a matrix that are not zero by structure."""


def diagonal(variances: Sequence[Any]) -> Covariance:
    """Covariance of independent components; every entry is data."""
    return tuple(tuple(data(v) if i == j else 0.0 for j in range(i + 1)) for i, v in enumerate(variances))


def entry(P: Covariance, i: int, j: int) -> Any:
    """P[i][j] of a lower triangle."""
    return P[i][j] if j <= i else P[j][i]


def transition(R_WB: Mat3, force_W: Vec3, dt: Any, *, modelled: bool = False) -> list[Row]:
    """Rows of the error's transition over ``dt``, to first order.

    position + velocity dt; velocity - (R f) x attitude dt - R accelerometer bias dt; attitude - R gyroscope bias dt.
    Where the force is modelled the velocity takes the push in place of the accelerometer's bias.

    Args:
        R_WB: attitude.
        force_W: specific force less its bias, or the modelled one, world axes, m/s^2.
        dt: s.
        modelled: whether the force comes from a model.

    Source: Sola 2017, equation 311 with the attitude's error in world axes (section 7.1).
    """
    rows: list[Row] = [{i: 1, i + 3: dt} for i in range(3)]
    turning, turned = Mat3.cross(force_W).rows, R_WB.rows
    step = neg(dt)
    for i in range(3):
        row = {VELOCITY + i: 1, **{ATTITUDE + j: mul(turning[i][j], step) for j in range(3) if j != i}}
        if modelled:
            row[PUSH + i] = dt
        else:
            row |= {ACCELEROMETER_BIAS + j: turned[i][j] * step for j in range(3)}
        rows.append(row)
    rows += [{ATTITUDE + i: 1, **{GYRO_BIAS + j: turned[i][j] * step for j in range(3)}} for i in range(3)]
    return rows + [{i: 1} for i in range(GYRO_BIAS, PUSH + 3 if modelled else PUSH)]


def predict_covariance(P: Covariance, F: Sequence[Row], variances: Sequence[Any]) -> Covariance:
    """F P F^T with ``variances`` added to the diagonal; structural zeros of the diagonal fold away."""
    size = len(P)
    FP = [[_sum(mul(c, entry(P, k, j)) for k, c in F[i].items()) for j in range(size)] for i in range(size)]
    return tuple(
        tuple(add(_sum(mul(FP[i][k], c) for k, c in F[j].items()), variances[i] if i == j else 0) for j in range(i + 1))
        for i in range(size)
    )


def update_by_scalar(
    P: Covariance, error: Sequence[Any], H: Row, innovation: Any, variance: Any
) -> tuple[Covariance, list[Any], Any]:
    """Covariance, mean error and normalised squared innovation after one scalar measurement.

    Args:
        P: before.
        error: mean of the error, as measurements of the same instant have made it so far.
        H: derivative of the measurement by the error.
        innovation: measurement less its prediction with no error.
        variance: of the measurement's noise.
    """
    PH = [_sum(mul(entry(P, i, j), c) for j, c in H.items()) for i in range(len(P))]
    total = _sum(mul(PH[i], c) for i, c in H.items()) + variance
    left = sub(innovation, _sum(mul(error[i], c) for i, c in H.items()))
    inverse = divide(1.0, total)
    K = [each * inverse for each in PH]
    after = tuple(tuple(P[i][j] - K[i] * PH[j] for j in range(i + 1)) for i in range(len(P)))
    return after, [add(e, k * left) for e, k in zip(error, K, strict=True)], left * left * inverse


def choose_covariance(condition: Any, new: Covariance, old: Covariance) -> Covariance:
    """``new`` where the condition holds, else ``old``."""
    return tuple(
        tuple(where(condition, a, b) for a, b in zip(row, before, strict=True))
        for row, before in zip(new, old, strict=True)
    )


def scaled_covariance(P: Covariance, factor: Any) -> Covariance:
    """A covariance times a number."""
    return tuple(tuple(each * factor for each in row) for row in P)


def gate_of(deviations: Any, count: int) -> Any:
    """Largest normalised squared innovation of ``count`` scalars that is taken for one of the model.

    The quantile of chi-square with ``count`` degrees of freedom whose probability is that of a normal number below
    ``deviations``: of 3 to 4.5 deviations to 15 % for one scalar, 7 % for three, 4 % for six, and too large.

    Source: Wilson, Hilferty 1931.
    """
    share = 2.0 / (9.0 * count)
    root = 1.0 - share + deviations * share**0.5
    return root * root * root * count


def _sum(terms: Any) -> Any:
    total: Any = 0
    for term in terms:
        total = add(total, term)
    return total
