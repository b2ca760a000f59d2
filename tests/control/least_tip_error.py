"""The least tip error of any linear law in gusts: sideways, of a hanging arm that gives
way along its plane only.

    python tests/control/least_tip_error.py [--deviation 0.437 1.106]

States are c, c', theta, theta', the angular acceleration that the rotors give (a lag of
the first order), and two of Dryden's lateral gusts:

    c'' = g theta + d,   theta'' = a + (m h / I) d,   tip = c - lever theta,

h the height of the base, on which the wind acts, above the centre of mass. A command
acts for one control period. Of laws with E u^2 <= u_max^2, as every law within the
torque's limit has it, none has a smaller E tip^2 than

    max over mu >= 0 of  min E[tip^2 + mu u^2] - mu u_max^2,

because the minimum is at most what such a law has; it is that of the linear quadratic
Gaussian regulator, which knows all numbers above. Prints that bound with perfect
knowledge of the state and the gust at once, and with the noise of the bench in
measurements that are one period old, with and without an accelerometer; and of the
regulators of several mu, observed through that noise, the least error of those that
stay stable with their commands 10, 20 and 30 ms late.
Source: Kwakernaak, Sivan 1972 (regulator, filter, separation); Boyd, Vandenberghe 2004,
chapter 5 (weak duality).
"""

import argparse
import dataclasses

import numpy as np
from scipy.linalg import (
    expm,
    solve_continuous_lyapunov,
    solve_discrete_are,
    solve_discrete_lyapunov,
)

import skyarm
from skyarm.algebra import Mat3
from skyarm.dynamics import mass_matrix
from skyarm.dynamics.kinematics import frame_pose
from skyarm.studies.trial.trial import NOISE

G, DT, LENGTH, HEARD = 9.81, 0.005, 3.0, 0.05
MEAN = np.sqrt(2.0 / np.pi)
"""Of the distance over its root mean square, where it is normal."""


@dataclasses.dataclass(frozen=True)
class Plane:
    """What of a vehicle counts sideways; SI."""

    lever: float
    height: float
    mass: float
    inertia: float
    lag: float
    torque: float

    @property
    def largest(self):
        """Angular acceleration that the torque's limit gives, rad/s^2."""
        return self.torque / self.inertia


def plane_of(name="hummingbird_arm2_rotors"):
    """The vehicle with its arm hanging; rotors with the shorter of their two lags,
    torque at any thrust.
    """
    vehicle = skyarm.load_vehicle(name)
    M = np.array(mass_matrix(vehicle, Mat3.identity(), (0.0,) * vehicle.n), dtype=float)
    mass, height = M[0, 0], -M[0, 4] / M[0, 0]
    tip = float(frame_pose(vehicle, vehicle.frame(), (0.0,) * vehicle.n).p.z)
    sides = [
        float(r.position.y) * float(r.thrust_coefficient) * float(r.max_speed) ** 2
        for r in vehicle.rotors
    ]
    return Plane(
        lever=float(-height - tip),
        height=float(height),
        mass=float(mass),
        inertia=float(M[3, 3] - mass * height**2),
        lag=min(float(r.time_constant_up) for r in vehicle.rotors),
        torque=sum(side for side in sides if side > 0.0),
    )


def system(plane, airspeed, deviation, dt=DT):
    """F, H, W of a period (gust noise W), and the tip's row; the last two states give
    d = row of gust.
    """
    time = LENGTH / airspeed
    A, B, white = np.zeros((7, 7)), np.zeros((7, 1)), np.zeros((7, 7))
    A[0, 1], A[1, 2], A[2, 3], A[3, 4] = 1.0, G, 1.0, 1.0
    A[4, 4], B[4] = -1.0 / plane.lag, 1.0 / plane.lag
    A[5, 6], A[6, 5], A[6, 6], white[6, 6] = 1.0, -1.0 / time**2, -2.0 / time, 1.0
    gust = np.array([1.0, np.sqrt(3.0) * time])
    gust *= deviation / np.sqrt(
        gust @ solve_continuous_lyapunov(A[5:, 5:], -white[5:, 5:]) @ gust
    )
    A[1, 5:], A[3, 5:] = gust, gust * (plane.mass * plane.height / plane.inertia)
    step = expm(np.block([[A, B], [np.zeros((1, 8))]]) * dt)
    loan = expm(np.block([[-A, white], [np.zeros((7, 7)), A.T]]) * dt)  # Van Loan 1978
    F = step[:7, :7]
    return (
        F,
        step[:7, 7:],
        F @ loan[:7, 7:],
        np.array([[1.0, 0.0, -plane.lever, 0.0, 0.0, 0.0, 0.0]]),
        gust,
    )


def sensors(plane, gust, accelerometer):
    """Rows and noise of what the bench measures: place, velocity, attitude, rate, and
    the specific force.
    """
    rows, noise = (
        np.eye(4, 7),
        [
            NOISE.position,
            NOISE.velocity,
            NOISE.attitude,
            NOISE.rate,
        ],
    )
    if accelerometer:
        felt = np.array([0.0, 0.0, 0.0, 0.0, plane.height, *gust])
        felt[5:] += plane.height * plane.mass * plane.height / plane.inertia * gust
        rows, noise = np.vstack([rows, felt]), [*noise, HEARD]
    return rows, np.diag(np.square(noise))


def regulator(F, H, C, mu):
    """Gain and value matrix of the least E[tip^2 + mu u^2]."""
    S = solve_discrete_are(F, H, C.T @ C, [[mu]])
    return np.linalg.solve(mu + H.T @ S @ H, H.T @ S @ F), S


def foretelling(F, W, rows, noise):
    """Gain and error covariance of the state told by measurements up to the period
    before.
    """
    P = solve_discrete_are(F.T, rows.T, W + 1e-14 * np.eye(7), noise)
    return F @ P @ rows.T @ np.linalg.inv(rows @ P @ rows.T + noise), P


def cost(plane, airspeed, deviation, mu, known):
    """Least E[tip^2 + mu u^2]; ``known`` is "all", "heard" (with an accelerometer) or
    "measured".
    """
    F, H, W, C, gust = system(plane, airspeed, deviation)
    K, S = regulator(F, H, C, mu)
    value = np.trace(S @ W)
    if known != "all":
        _, P = foretelling(F, W, *sensors(plane, gust, known == "heard"))
        value += (K @ P @ K.T * (mu + H.T @ S @ H))[0, 0]
    return float(value)


def least(plane, airspeed, deviation, known):
    """The bound on the root mean square of the tip, m."""
    prices = np.logspace(-10.0, -5.0, 41)
    bounds = [
        cost(plane, airspeed, deviation, mu, known) - mu * plane.largest**2
        for mu in prices
    ]
    return float(np.sqrt(max(bounds)))


def closed_loop(plane, airspeed, deviation, mu, known, late=0):
    """Matrix of plant, commands on their way (``late`` periods) and filter, and the
    covariance of its noise.
    """
    F, H, W, C, gust = system(plane, airspeed, deviation)
    rows, noise = sensors(plane, gust, known == "heard")
    (K, _), (L, _) = regulator(F, H, C, mu), foretelling(F, W, rows, noise)
    n = 14 + late
    A, Q = np.zeros((n, n)), np.zeros((n, n))
    A[:7, :7], A[7:14, :7], A[7:14, 7:14] = F, L @ rows, F - L @ rows - H @ K
    if late:
        A[:7, 14:15] = H
        A[14:-1, 15:] = np.eye(late - 1)
        A[-1:, 7:14] = -K
    else:
        A[:7, 7:14] = -H @ K
    Q[:7, :7], Q[7:14, 7:14] = W, L @ noise @ L.T
    return A, Q, C, K


def errors(plane, airspeed, deviation, mu, known):
    """Root mean squares of the tip, m, and of the command over its limit, of the loop
    with its commands on time.
    """
    A, Q, C, K = closed_loop(plane, airspeed, deviation, mu, known)
    P = solve_discrete_lyapunov(A, Q)
    effort = K @ P[7:14, 7:14] @ K.T
    return (
        float(np.sqrt((C @ P[:7, :7] @ C.T)[0, 0])),
        float(np.sqrt(effort[0, 0])) / plane.largest,
    )


def bears(plane, airspeed, deviation, mu, known, late):
    """Whether the loop is stable with commands from 0 to ``late`` periods later than
    the regulator knows.
    """
    loops = (
        closed_loop(plane, airspeed, deviation, mu, known, each)[0]
        for each in range(late + 1)
    )
    return all(np.abs(np.linalg.eigvals(A)).max() < 1.0 for A in loops)


def least_that_bears(plane, airspeed, deviation, known, late):
    """Least root mean square of the tip, m, of the regulators within the torque that
    bear ``late`` periods; or NaN.
    """
    prices = [
        mu
        for mu in np.logspace(-9.0, 0.0, 46)
        if bears(plane, airspeed, deviation, mu, known, late)
    ]
    found = [errors(plane, airspeed, deviation, mu, known) for mu in prices]
    return min((tip for tip, effort in found if effort <= 1.0), default=np.nan)


def shown(found):
    """Mean distances in mm of root mean squares in m."""
    return {key: round(float(1e3 * MEAN * value), 1) for key, value in found.items()}


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--deviation", type=float, nargs=2, default=(0.437, 1.106), metavar="M/S^2"
    )
    plane = plane_of()
    print(plane, f"largest {plane.largest:.1f} rad/s^2; mean of the tip's distance, mm")
    for airspeed, deviation in zip(
        (3.0, 6.0), parser.parse_args().deviation, strict=True
    ):
        bounds = {
            known: least(plane, airspeed, deviation, known)
            for known in ("all", "heard", "measured")
        }
        print(
            f"{airspeed:g} m/s, force {deviation:g} m/s^2: no linear law below",
            shown(bounds),
        )
        for known in ("heard", "measured"):
            lates = {
                5 * k: least_that_bears(plane, airspeed, deviation, known, k)
                for k in (0, 2, 4, 6)
            }
            print(
                f"  {known}, regulators that bear commands late by (ms)", shown(lates)
            )


if __name__ == "__main__":
    main()
