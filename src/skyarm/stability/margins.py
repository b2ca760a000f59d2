"""Eigenvalues and margins of a sampled loop: how much delay and how much gain it bears."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.stability.open_loop import OpenLoop

Array = npt.NDArray[np.float64]

EDGE = 1.0 + 1e-7
"""Spectral radius above which a loop counts as unstable: the differences are good to 1e-9."""

LONGEST = 0.1
"""s, largest extra delay that is looked at."""

WIDEST, STRIDE = 100.0, 1.25
"""Largest change of a gain that is looked at, and the factor between two looks."""

HALVINGS, FEW_HALVINGS = 24, 10
"""Of the interval that holds a gain margin: to 1e-8 of it; of single actuators, which are many, to 2e-4."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Margins:
    """Of one linearised loop.

    Attributes:
        z: eigenvalues per control period, largest first. s: the same as rates, 1/s, log(z) / period.
        radius: largest |z|; the loop is stable below 1.
        delay: s of further dead time of the commands that the loop bears; inf beyond 0.1 s, 0 if it is unstable.
        rotor_gain, joint_gain: (lower, upper) factors on the effect of all rotor commands, of all torques, between
            which the loop is stable; 0 and inf beyond a hundredfold. The factor is common to the group.
        one_rotor, one_joint: the same of one actuator alone, the others as they are: the largest lower and the smallest
            upper factor of any of them.
    """

    z: npt.NDArray[np.complex128]
    s: npt.NDArray[np.complex128]
    radius: float
    delay: float
    rotor_gain: tuple[float, float]
    joint_gain: tuple[float, float]
    one_rotor: tuple[float, float]
    one_joint: tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Closed:
    """A loop closed over some dead time, for any gains of its actuators: the matrix is ``fixed + enters @ (k sent)``.

    Attributes:
        fixed: (n, n) what no command passes. enters: (n, commands) where commands enter the next period.
        sent: (commands, n) the law's commands.
    """

    fixed: Array
    enters: Array
    sent: Array

    def matrix(self, gains: Array) -> Array:
        """Matrix of one period with a gain k for each command (commands,)."""
        return np.asarray(self.fixed + self.enters @ (self.sent * gains[:, None]))


def closed(loop: OpenLoop, extra_delay: float = 0.0) -> Closed:
    """One period: [state, memory, measurements on their way, commands on their way] to the next.

    ``extra_delay`` (s, with the loop's own a multiple of its ``lates``) joins the commands' own, the rotors' and the
    joints' alike.
    """
    age_of_rotors, late = _split(loop, loop.command_delay + loop.rotors_delay + extra_delay)
    age_of_joints, _ = _split(loop, loop.command_delay + loop.joints_delay + extra_delay)
    whole = max(age_of_rotors, age_of_joints)
    nx, nm, nu, ny = loop.x_x.shape[1], len(loop.m_m), loop.u_m.shape[0], len(loop.y_x)
    r = loop.measurement_delay
    ends = np.cumsum([0, nx, nm, *[ny] * r, *[nu] * (whole + 1)])
    places = [slice(int(a), int(b)) for a, b in pairwise(ends)]
    x, m, readings, queue = places[0], places[1], places[2 : 2 + r], places[2 + r :]
    size = int(ends[-1])
    one = np.eye(size)
    now = np.zeros((ny, size))
    now[:, x] = loop.y_x
    # columns of the commands that act, in what each part of the vehicle has heard of so far
    parts = [
        (np.arange(loop.rotors), whole - age_of_rotors),
        (np.arange(loop.rotors, nu), whole - age_of_joints),
    ]
    for columns, heard in parts:
        now[:, queue[heard].start + columns] = loop.y_old[:, columns]
    seen = one[readings[0]] if r else now
    sent = loop.u_y @ seen
    sent[:, m] += loop.u_m
    A, enters = np.zeros((size, size)), np.zeros((size, nu))
    A[x, x] = loop.x_x[late]
    for columns, heard in parts:
        A[x, queue[heard].start + columns] = loop.x_old[late][:, columns]
        # the command that follows is the next on its way, or where none is what is sent now
        if heard < whole:
            A[x, queue[heard + 1].start + columns] = loop.x_new[late][:, columns]
        else:
            enters[x, columns] = loop.x_new[late][:, columns]
    A[m] = loop.m_y @ seen
    A[m, m] += loop.m_m
    for i, place in enumerate(readings):
        A[place] = np.eye(size)[readings[i + 1]] if i + 1 < r else now
    for place, after in pairwise(queue):
        A[place] = one[after]
    enters[queue[-1]] = np.eye(nu)
    kept = _in_loop(A, enters, sent, nx)
    return Closed(A[np.ix_(kept, kept)], enters[kept], sent[:, kept])


def gains(
    loop: OpenLoop, *, rotor_gain: float = 1.0, joint_gain: float = 1.0, alone: tuple[int, float] | None = None
) -> Array:
    """Factor on what the actuators make of each command, not on what the law believes it sent (commands,).

    ``alone`` is the place of one command, from 0 with the rotors first, and a further factor on it.
    """
    found = np.array([rotor_gain] * loop.rotors + [joint_gain] * (loop.u_m.shape[0] - loop.rotors))
    if alone is not None:
        found[alone[0]] *= alone[1]
    return found


def closed_loop(loop: OpenLoop, *, extra_delay: float = 0.0, **changes: Any) -> Array:
    """Matrix of one period, with a delay as :func:`closed` and gains as :func:`gains` say."""
    return closed(loop, extra_delay).matrix(gains(loop, **changes))


def _split(loop: OpenLoop, delay: float) -> tuple[int, int]:
    """Whole periods of a delay, and which of ``lates`` the rest is."""
    step = loop.period / len(loop.lates)
    count = round(delay / step)
    if abs(delay - count * step) > 1e-6 * step + 1e-12:
        raise ValueError(f"delay = {delay!r}: must be a whole number of {step:g} s")
    return divmod(count, len(loop.lates))


def _in_loop(A: Array, enters: Array, sent: Array, nx: int) -> npt.NDArray[np.bool_]:
    """Entries that the state acts on and that act on the state: clocks and bookkeeping are no loop."""
    links = (A != 0.0) | (((enters != 0.0).astype(float) @ (sent != 0.0).astype(float)) > 0.0)
    first = np.zeros(len(A), dtype=bool)
    first[:nx] = True
    return _reached(links, first) & _reached(links.T, first)


def _reached(links: npt.NDArray[np.bool_], first: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """What is acted on from ``first``, in any number of periods."""
    found = first
    while True:
        more = found | (links[:, found].any(axis=1))
        if (more == found).all():
            return found
        found = more


def radius(loop: OpenLoop, **changes: Any) -> float:
    """Spectral radius of the closed loop, changed as :func:`closed_loop` says; inf where it is not finite."""
    return _radius(closed_loop(loop, **changes))


def _radius(A: Array) -> float:
    if not np.isfinite(A).all():
        return math.inf
    return float(np.abs(np.linalg.eigvals(A)).max(initial=0.0))


def margins(loop: OpenLoop) -> Margins:
    """Eigenvalues and margins of a loop."""
    as_it_is = closed(loop)
    z = np.linalg.eigvals(as_it_is.matrix(gains(loop))).astype(complex)
    z = z[np.argsort(-np.abs(z), kind="stable")]
    with np.errstate(divide="ignore"):
        s = np.log(z) / loop.period

    def at(**changes: Any) -> float:
        return _radius(as_it_is.matrix(gains(loop, **changes)))

    return Margins(
        z=z,
        s=s,
        radius=float(np.abs(z).max(initial=0.0)),
        delay=delay_margin(loop),
        rotor_gain=_gain_margin(lambda k: at(rotor_gain=k)),
        joint_gain=_gain_margin(lambda k: at(joint_gain=k)),
        one_rotor=_of_any(at, range(loop.rotors)),
        one_joint=_of_any(at, range(loop.rotors, loop.u_m.shape[0])),
    )


def _of_any(radius_at: Callable[..., float], places: range) -> tuple[float, float]:
    """The narrowest interval of single commands; everything is borne where there is none."""

    def margin(place: int) -> tuple[float, float]:
        return _gain_margin(lambda k: radius_at(alone=(place, k)), FEW_HALVINGS)

    found = [margin(place) for place in places]
    return max((low for low, _ in found), default=0.0), min((high for _, high in found), default=math.inf)


def delay_margin(loop: OpenLoop) -> float:
    """Extra dead time, s, at which the spectral radius passes 1, between two steps of ``lates`` on a line."""
    step = loop.period / len(loop.lates)
    before = radius(loop)
    if before > EDGE:
        return 0.0
    for k in range(1, math.floor(LONGEST / step + 0.5) + 1):
        after = radius(loop, extra_delay=k * step)
        if after > EDGE:
            # the last stable radius may be 1 itself, where an eigenvalue only touches the circle
            share = (1.0 - min(before, 1.0)) / (after - min(before, 1.0))
            return (k - 1 + share) * step
        before = after
    return math.inf


def _gain_margin(radius_at: Callable[[float], float], halvings: int = HALVINGS) -> tuple[float, float]:
    """(lower, upper) factor at which the loop becomes unstable; (1, 1) if it is so already."""
    if radius_at(1.0) > EDGE:
        return 1.0, 1.0
    return _edge(radius_at, 1.0 / STRIDE, 0.0, halvings), _edge(radius_at, STRIDE, math.inf, halvings)


def _edge(radius_at: Callable[[float], float], factor: float, beyond: float, halvings: int) -> float:
    """First gain from 1 on, in strides of ``factor``, at which the loop is unstable; ``beyond`` if there is none."""
    stable, gain = 1.0, factor
    while 1.0 / WIDEST <= gain <= WIDEST:
        if radius_at(gain) > EDGE:
            unstable = gain
            for _ in range(halvings):
                middle = math.sqrt(stable * unstable)
                stable, unstable = (stable, middle) if radius_at(middle) > EDGE else (middle, unstable)
            return stable
        stable, gain = gain, gain * factor
    return beyond
