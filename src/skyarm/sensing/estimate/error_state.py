"""Error-state Kalman filter over scalars: covariance, inertial navigation, innovations.

The error has fifteen components: position (m), velocity (m/s), attitude (rotation
vector, rad, world axes: the truth is exp(error) times the estimate), bias of the
gyroscope (rad/s) and of the accelerometer (m/s^2), base axes; three more where the
force is modelled: what the model lacks (m/s^2, world axes). A covariance is the lower
triangle, row by row: P[i][j] for j <= i. Between two inertial readings angular rate and
specific force are taken as the mean of both, which also holds the noise of each reading
once in the sum.

Sources: Sola 2017, "Quaternion kinematics for the error-state Kalman filter", equation
260 and section 7 (errors in world axes); Bierman 1977 (update by independent scalars
one by one); Titterton, Weston 2004, chapter 11.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any

from skyarm.algebra import ZERO3, Mat3, Quaternion, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import (
    add,
    atan2,
    cos,
    data,
    divide,
    mul,
    neg,
    same,
    sin,
    sqrt,
    sub,
    total,
    where,
)
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit
from skyarm.sensing.sensor_kinds import (
    HeadingReading,
    ImuReading,
    PoseReading,
    PositionReading,
)

Aid = PoseReading | PositionReading | HeadingReading
"""Reading that corrects the inertial unit."""

POSITION, VELOCITY, ATTITUDE, GYRO_BIAS, ACCELEROMETER_BIAS, PUSH = 0, 3, 6, 9, 12, 15
"""Index of the first component of each part of the error state."""

Covariance = tuple[Scalars, ...]
Row = Mapping[int, Scalar]
"""Structurally non-zero entries of a row of a matrix."""


def diagonal(variances: Sequence[Scalar]) -> Covariance:
    """Diagonal covariance matrix as a lower triangle, from the variances."""
    return tuple(
        tuple(data(v) if i == j else 0.0 for j in range(i + 1))
        for i, v in enumerate(variances)
    )


def entry(P: Covariance, i: int, j: int) -> Scalar:
    """Element P[i][j] of a symmetric matrix that is stored as its lower triangle."""
    return P[i][j] if j <= i else P[j][i]


def transition(
    R_WB: Mat3, force_W: Vec3, dt: Scalar, *, modelled: bool = False
) -> list[Row]:
    """Sparse rows of the error-state transition matrix over ``dt`` (s), to first order.

    position + velocity dt; velocity - (R f) x attitude dt - R accelerometer bias dt;
    attitude - R gyroscope bias dt. Where the force is modelled the velocity takes the
    push in place of the accelerometer's bias.

    Args:
        R_WB: attitude.
        force_W: specific force less its bias, or the modelled one, world axes, m/s^2.
        dt: s.
        modelled: True if the force comes from a model.

    Source: Sola 2017, equation 311 with the attitude's error in world axes (section
    7.1).
    """
    rows: list[Row] = [{i: 1, i + 3: dt} for i in range(3)]
    turning, turned = Mat3.cross(force_W).rows, R_WB.rows
    step = neg(dt)
    for i in range(3):
        # the diagonal of a cross matrix is zero, which is left out of the sparse row
        row = {
            VELOCITY + i: 1,
            **{ATTITUDE + j: mul(turning[i][j], step) for j in range(3) if j != i},
        }
        if modelled:
            row[PUSH + i] = dt
        else:
            row |= {ACCELEROMETER_BIAS + j: turned[i][j] * step for j in range(3)}
        rows.append(row)
    rows += [
        {ATTITUDE + i: 1, **{GYRO_BIAS + j: turned[i][j] * step for j in range(3)}}
        for i in range(3)
    ]
    return rows + [{i: 1} for i in range(GYRO_BIAS, PUSH + 3 if modelled else PUSH)]


def predict_covariance(
    P: Covariance, F: Sequence[Row], variances: Sequence[Scalar]
) -> Covariance:
    """Predicted covariance F P F^T + diag(variances)."""
    size = len(P)
    # most entries of F are zero, so that sums go over the others alone
    FP = [
        [total(mul(c, entry(P, k, j)) for k, c in F[i].items()) for j in range(size)]
        for i in range(size)
    ]
    return tuple(
        tuple(
            add(
                total(mul(FP[i][k], c) for k, c in F[j].items()),
                variances[i] if i == j else 0,
            )
            for j in range(i + 1)
        )
        for i in range(size)
    )


def update_by_scalar(
    P: Covariance, error: Sequence[Scalar], H: Row, innovation: Scalar, variance: Scalar
) -> tuple[Covariance, list[Scalar], Scalar]:
    """Kalman update by one scalar measurement: covariance, mean error and normalised
    squared innovation.

    Args:
        P: covariance before the update.
        error: mean of the error, as measurements of the same instant have made it so
            far.
        H: derivative of the measurement by the error.
        innovation: measurement minus its prediction by the nominal state.
        variance: variance of the measurement's noise.
    """
    PH = [total(mul(entry(P, i, j), c) for j, c in H.items()) for i in range(len(P))]
    spread = total(mul(PH[i], c) for i, c in H.items()) + variance
    # the nominal state is corrected after the last scalar of an instant only, so what
    # earlier ones have found is subtracted here
    left = sub(innovation, total(mul(error[i], c) for i, c in H.items()))
    inverse = divide(1.0, spread)
    K = [each * inverse for each in PH]
    # the lower triangle alone is made, so rounding cannot make it asymmetric
    after = tuple(
        tuple(P[i][j] - K[i] * PH[j] for j in range(i + 1)) for i in range(len(P))
    )
    return (
        after,
        [add(e, k * left) for e, k in zip(error, K, strict=True)],
        left * left * inverse,
    )


def scaled_covariance(P: Covariance, factor: Scalar) -> Covariance:
    """Covariance times a scalar factor."""
    return tuple(tuple(each * factor for each in row) for row in P)


def gate_of(deviations: Scalar, count: int) -> Scalar:
    """Innovation gate: largest accepted normalised squared innovation of ``count``
    scalars.

    The quantile of chi-square with ``count`` degrees of freedom whose probability is
    that of a normal number below ``deviations``: of 3 to 4.5 deviations to 15 % for one
    scalar, 7 % for three, 4 % for six, and too large.

    Source: Wilson, Hilferty 1931.
    """
    share = 2.0 / (9.0 * count)
    root: Scalar = 1.0 - share + deviations * share**0.5
    return root * root * root * count


@immutable
class Navigated:
    """Nominal state of the error-state filter: position, velocity, attitude, biases,
    unmodelled acceleration.

    Position and velocity are those of the inertial unit, at the base origin unless it
    has a place of its own.
    """

    position: Annotated[
        Vec3, Unit("m", "estimated position of the inertial unit, world axes")
    ]
    velocity: Annotated[
        Vec3, Unit("m/s", "estimated velocity of the inertial unit, world axes")
    ]
    quaternion: Annotated[
        Quaternion, Unit("", "estimated attitude w x y z, base to world")
    ]
    gyro_bias: Annotated[
        Vec3, Unit("rad/s", "estimated bias of the gyroscope, base axes")
    ]
    accelerometer_bias: Annotated[
        Vec3, Unit("m/s^2", "estimated bias of the accelerometer, base axes")
    ]
    push: Annotated[
        Vec3, Unit("m/s^2", "estimated specific force beyond the model, world axes")
    ] = ZERO3


def navigate(
    now: Navigated,
    before: ImuReading,
    after: ImuReading,
    gravity: Any,
    dt: Scalar,
    modelled: Vec3 | None = None,
) -> tuple[Navigated, Vec3]:
    """Inertial navigation step: next nominal state, and mean specific force without
    bias (world axes, m/s^2).

    Args:
        now: nominal state at the earlier.
        before: reading at the earlier.
        after: reading at the later.
        gravity: m/s^2.
        dt: s between them.
        modelled: mean specific force between them by a model, base axes, in place of
            the accelerometer's.
    """
    rate = (before.rate + after.rate) * 0.5 - now.gyro_bias
    turned = (now.quaternion * Quaternion.of_small_rotation(rate, dt)).renormalized()
    old, new = now.quaternion.rotation(), turned.rotation()
    bias = now.accelerometer_bias
    pair = (
        (before.specific_force - bias, after.specific_force - bias)
        if modelled is None
        else (modelled, modelled)
    )
    # each end in its own attitude: the vehicle turns within the step
    force = (old.apply(pair[0]) + new.apply(pair[1])) * 0.5
    up = force + now.push
    acceleration = Vec3(up.x, up.y, up.z - gravity)
    following = replace(
        now,
        position=now.position + (now.velocity + acceleration * (0.5 * dt)) * dt,
        velocity=now.velocity + acceleration * dt,
        quaternion=turned,
    )
    return following, force


def correct_state(now: Navigated, error: Sequence[Scalar]) -> Navigated:
    """Nominal state corrected by the mean error (error injection)."""
    p, v, turn, gyro, accelerometer, *push = (
        Vec3(*error[i : i + 3]) for i in range(0, len(error), 3)
    )
    return Navigated(
        position=now.position + p,
        velocity=now.velocity + v,
        quaternion=(
            # on the left, because the attitude's error is in world axes
            Quaternion.of_rotation_vector(turn) * now.quaternion
        ).renormalized(),
        gyro_bias=now.gyro_bias + gyro,
        accelerometer_bias=now.accelerometer_bias + accelerometer,
        push=now.push + push[0] if push else now.push,
    )


def level_attitude(specific_force: Vec3, heading: Scalar) -> Quaternion:
    """Attitude of a base at rest, from its specific force (which points up) and its
    heading (rad).
    """
    f = specific_force
    # a quaternion has half the angles
    roll = 0.5 * atan2(f.y, f.z)
    pitch = 0.5 * atan2(neg(f.x), sqrt(f.y * f.y + f.z * f.z))
    yaw = 0.5 * heading
    level = Quaternion(cos(yaw), 0.0, 0.0, sin(yaw)) * Quaternion(
        cos(pitch), 0.0, sin(pitch), 0.0
    )
    return level * Quaternion(cos(roll), sin(roll), 0.0, 0.0)


@immutable
class ScalarInnovation:
    """Innovation of one scalar measurement: Jacobian row, innovation and noise
    variance.
    """

    H: Row
    value: Scalar
    variance: Scalar


def innovations(
    belief: Navigated,
    reading: Aid,
    position: Scalar,
    attitude: Scalar,
    heading: Scalar,
    place: Vec3 = ZERO3,
) -> list[ScalarInnovation]:
    """Innovations of a pose, position or heading reading, with given standard
    deviations of the sensors' noise.

    Of an inertial unit at a place r (m, base axes) from the base origin, the position
    is read R r away from the believed one, and an attitude's error e moves it by (R r)
    x e.
    """
    if isinstance(reading, HeadingReading):
        return [
            _of_heading(
                belief.quaternion.rotation(), reading.heading, heading * heading
            )
        ]
    arm = belief.quaternion.rotation().apply(place)
    turned = [
        # a unit at the base origin has exact zeros here, which drop out of the row
        {ATTITUDE + j: c for j, c in enumerate(row) if not same(c, 0)}
        for row in Mat3.cross(arm).rows
    ]
    off = enumerate(reading.position - (belief.position - arm))
    rows = [
        ScalarInnovation(
            H={POSITION + i: 1, **turned[i]}, value=c, variance=position * position
        )
        for i, c in off
    ]
    if isinstance(reading, PoseReading):
        turns = enumerate(turn_between(belief.quaternion, reading.quaternion))
        rows += [
            ScalarInnovation(H={ATTITUDE + i: 1}, value=c, variance=attitude * attitude)
            for i, c in turns
        ]
    return rows


def turn_between(
    believed: Quaternion, read: Quaternion
) -> tuple[Scalar, Scalar, Scalar]:
    """Rotation vector (rad, world axes, to second order) from the estimated to the
    measured attitude.
    """
    turn = read * believed.conjugate()
    # q and -q are one attitude: the sign chooses the turn of less than half a turn
    factor = where(turn.w < 0.0, -2.0, 2.0)
    return turn.x * factor, turn.y * factor, turn.z * factor


def _of_heading(R: Mat3, heading: Scalar, variance: Scalar) -> ScalarInnovation:
    """Innovation (rad, between -pi and pi) of a measured heading, the yaw of the base's
    x axis.

    A small rotation e (world axes) moves the axis by e x axis: its yaw by e_z - z (x
    e_x + y e_y) / (x^2 + y^2).
    """
    x, y, z = R.column(0)
    level = divide(z, x * x + y * y)
    off = heading - atan2(y, x)
    H = {ATTITUDE: -(level * x), ATTITUDE + 1: -(level * y), ATTITUDE + 2: 1}
    # atan2 of sine and cosine brings the difference within half a turn
    return ScalarInnovation(H=H, value=atan2(sin(off), cos(off)), variance=variance)


def of_specific_force(
    belief: Navigated, measured: Vec3, modelled: Vec3, variance: Scalar
) -> list[ScalarInnovation]:
    """Innovations of the accelerometer against the specific force that the vehicle
    model predicts.

    The push d stands in world axes: an attitude's error e turns R^T d by R^T (d x e).
    """
    R = belief.quaternion.rotation()
    off = measured - modelled - R.apply_T(belief.push) - belief.accelerometer_bias
    rows = []
    for i, value in enumerate(off):
        axis = R.column(i)
        # row i of R^T S(d) is axis^T S(d) = (axis x d)^T
        turned = enumerate(axis.cross(belief.push))
        H: dict[int, Scalar] = {ATTITUDE + j: c for j, c in turned}
        H |= {ACCELEROMETER_BIAS + i: 1, **{PUSH + j: c for j, c in enumerate(axis)}}
        rows.append(ScalarInnovation(H=H, value=value, variance=variance))
    return rows
