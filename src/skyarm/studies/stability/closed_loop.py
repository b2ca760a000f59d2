"""Linearised sampled-data control loop: open loop cut at the commands, and closed loop
with its delays.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from skyarm.records.arrays import Array, Mask
from skyarm.records.immutable import immutable, positional
from skyarm.studies.stability.loop_channels import LoopChannel


@immutable
class OpenLoop:
    """Open-loop Jacobians; x: state (attitude as rotation vector), u: command, m:
    controller state, y: measurement.

    Attributes:
        period: s. rotors: number of entries of u that are rotor speeds; they come
            first.
        lates: times, s, within a period at which a new command takes effect, ascending
            from 0.
        x_x, x_old, x_new: (lates, ...) of the next state by state, acting and new
            command.
        y_x, y_old: derivatives of the measurement now.
        m_m, m_y, u_m, u_y: derivatives of the law, by its memory and the measurement it
            sees.
        measurement_delay: control periods. command_delay: s.
        states: number of entries of x that are the vehicle's own; those after them are
            memories of its joint drives. 0: all.
        channels: points where it is cut for the margins of single loops.
    """

    period: float
    rotors: int
    lates: Array
    x_x: Array
    x_old: Array
    x_new: Array
    y_x: Array
    y_old: Array
    m_m: Array
    m_y: Array
    u_m: Array
    u_y: Array
    measurement_delay: int = 0
    command_delay: float = 0.0
    states: int = 0
    channels: tuple[LoopChannel, ...]


@positional(eq=False)
class Closed:
    """Linear closed loop with variable actuator gains k: transition matrix ``fixed +
    enters @ diag(k) @ sent``.

    Attributes:
        fixed: (n, n) part without commands. enters: (n, commands) input matrix of the
            commands.
        sent: (commands, n) the law's commands. seen: (measurements, n) the law's
            measurements.
        shown: (n, measurements) effect of measurements on the law's memory.
        answered: (commands, measurements) direct effect of measurements on commands.
    """

    fixed: Array
    enters: Array
    sent: Array
    seen: Array
    shown: Array
    answered: Array

    def matrix(self, gains: Array) -> Array:
        """Transition matrix of the closed loop over one control period for actuator
        gains k (commands,).
        """
        return self.fixed + self.enters @ (self.sent * gains[:, None])


def close_loop(loop: OpenLoop, extra_delay: float = 0.0) -> Closed:
    """Close a linearised loop; the state is extended by controller state and delayed
    measurements and commands.

    ``extra_delay`` (s, with the loop's own a multiple of its ``lates``) joins that of
    the commands.
    """
    whole, late = _split(loop, loop.command_delay + extra_delay)
    nx = loop.x_x.shape[1]
    nm = len(loop.m_m)
    nu = loop.u_m.shape[0]
    ny = len(loop.y_x)
    r = loop.measurement_delay
    ends = np.cumsum([0, nx, nm, *[ny] * r, *[nu] * (whole + 1)])
    places = [slice(int(a), int(b)) for a, b in pairwise(ends)]
    x = places[0]
    m = places[1]
    readings = places[2 : 2 + r]
    queue = places[2 + r :]
    size = int(ends[-1])
    one = np.eye(size)
    now = np.zeros((ny, size))
    now[:, x] = loop.y_x
    now[:, queue[0]] = loop.y_old
    seen = one[readings[0]] if r else now
    sent = loop.u_y @ seen
    sent[:, m] += loop.u_m
    A, enters = np.zeros((size, size)), np.zeros((size, nu))
    A[x, x] = loop.x_x[late]
    A[x, queue[0]] = loop.x_old[late]
    # the command that follows is the next on its way, or where none is what is sent now
    if whole:
        A[x, queue[1]] = loop.x_new[late]
    else:
        enters[x] = loop.x_new[late]
    A[m] = loop.m_y @ seen
    A[m, m] += loop.m_m
    # measurements and commands move up by one place a period
    for place, after in (*pairwise(readings), *pairwise(queue)):
        A[place] = one[after]
    if r:
        A[readings[-1]] = now
    enters[queue[-1]] = np.eye(nu)
    shown = np.zeros((size, ny))
    shown[m] = loop.m_y
    states = _in_loop(A, enters, sent, loop.states or nx)
    return Closed(
        A[np.ix_(states, states)],
        enters[states],
        sent[:, states],
        seen[:, states],
        shown[states],
        loop.u_y,
    )


def gains(loop: OpenLoop, *, rotor_gain: float = 1.0, joint_gain: float = 1.0) -> Array:
    """Gain factors (commands,) on the response of rotors and joints, as in a gain
    margin.
    """
    return np.array(
        [rotor_gain] * loop.rotors + [joint_gain] * (loop.u_m.shape[0] - loop.rotors)
    )


def closed_loop(
    loop: OpenLoop, *, extra_delay: float = 0.0, **modified: float
) -> Array:
    """Transition matrix of the closed loop over one control period, with extra delay or
    modified gains.
    """
    return close_loop(loop, extra_delay).matrix(gains(loop, **modified))


def _split(loop: OpenLoop, delay: float) -> tuple[int, int]:
    """Split a delay (s) into whole control periods and the index of the remainder in
    the list ``lates``.
    """
    step = loop.period / len(loop.lates)
    count = round(delay / step)
    # sums of delays are whole multiples but for rounding
    if abs(delay - count * step) > 1e-6 * step + 1e-12:
        raise ValueError(f"delay = {delay!r}: must be a whole number of {step:g} s")
    return divmod(count, len(loop.lates))


def _in_loop(A: Array, enters: Array, sent: Array, states: int) -> Mask:
    """Mask of the states that belong to the feedback loop; clocks and other states
    outside of it are excluded.
    """
    # as floats, since BLAS multiplies no truth values
    links = (A != 0.0) | (
        ((enters != 0.0).astype(float) @ (sent != 0.0).astype(float)) > 0.0
    )
    # a state is in the loop if it acts on the vehicle and the vehicle on it
    first = np.zeros(len(A), dtype=bool)
    first[:states] = True
    return _reachable(links, first) & _reachable(links.T, first)


def _reachable(links: Mask, first: Mask) -> Mask:
    """Mask of the states reachable from the states ``first`` over any number of
    periods.
    """
    reached = first
    while True:
        more = reached | (links[:, reached].any(axis=1))
        if (more == reached).all():
            return reached
        reached = more


def radius(loop: OpenLoop, **modified: float) -> float:
    """Spectral radius of the closed loop with extra delay or modified gains; inf if not
    finite.
    """
    return spectral_radius(closed_loop(loop, **modified))


def spectral_radius(A: Array) -> float:
    """Spectral radius of a matrix; inf if it is not finite."""
    if not np.isfinite(A).all():
        return math.inf
    return float(np.abs(np.linalg.eigvals(A)).max(initial=0.0))
