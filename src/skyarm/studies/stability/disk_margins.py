"""Disk margins of a sampled loop, from the frequency responses at its channels.

A channel is multiplied by f = (1 + d / 2) / (1 - d / 2) with any complex d, also one
that varies with frequency, of magnitude below a: the disk margin a is the largest for
which the loop stays stable. With S the sensitivity it is 1 over the largest |S - 1/2|
of all frequencies; with several channels, each under a d of its own, the structured
singular value stands in place of the magnitude, here its upper bound, so that the
margin of several is never overstated. 2 is the largest: any positive gain and any phase
below 90 degrees are tolerated.

Sources: Seiler, Packard, Gahinet 2020, An Introduction to Disk Margins, IEEE Control
Systems Magazine 40 (5), eq. (11) with skew 0, theorem 1, and the section on
multiple-loop margins. Doyle 1982, Analysis of feedback systems with structured
uncertainties, IEE Proc. D 129 (6). Safonov 1982, Stability margins of diagonally
perturbed multivariable feedback systems, same issue.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from skyarm.records.arrays import Array, Complex, doubles, norm
from skyarm.records.immutable import immutable, positional
from skyarm.studies.stability.closed_loop import Closed, OpenLoop, gains
from skyarm.studies.stability.loop_channels import (
    COMMANDS,
    MEASUREMENTS,
    LoopChannel,
)

MOST = 2.0
"""Largest symmetric disk margin: S is 1 far above a sampled loop's bandwidth, so that
|S - 1/2| reaches a half."""


@immutable
class LoopMargin:
    """Disk margin of a control loop cut at one signal, or at several with independent
    perturbations.

    Attributes:
        name: name of the channel or of the group. group: group of the channel. port:
            "commands" or "measurements".
        channels: number of channels changed at once.
        disk: disk margin a, from 0 (unstable) to 2. frequency: critical frequency,
            rad/s.
        delay: delay margin of this one channel, s; inf beyond the searched range, and
            for several channels.
    """

    name: str
    group: str
    port: str
    channels: int = 1
    disk: float
    frequency: float
    delay: float = math.inf

    @property
    def gain(self) -> tuple[float, float]:
        """Gain margin: (lower, upper) factor at unchanged phase."""
        return (2.0 - self.disk) / (2.0 + self.disk), (
            (2.0 + self.disk) / (2.0 - self.disk) if self.disk < MOST else math.inf
        )

    @property
    def phase(self) -> float:
        """Phase margin (rad) in both directions at unchanged gain."""
        return 2.0 * math.atan(0.5 * self.disk)


def disk_of(size: float) -> float:
    """Disk margin from the peak ``size`` of |S - 1/2|, or of its structured singular
    value.
    """
    return min(MOST, 1.0 / size) if size > 0.0 else MOST


def delay_of(T: Complex, frequencies: Array, longest: float) -> float:
    """Delay margin (s) of a loop cut at one channel, from its frequency response; inf
    if above ``longest``.

    Args:
        T: closed-loop response (frequencies,) from an injection at a channel to the
            channel.
        frequencies: rad/s, ascending.
        longest: s.
    """
    # what is fed back is T / (1 + T), of magnitude 1 where the real part of T is -1/2
    side = T.real + 0.5
    here = np.flatnonzero(side[:-1] * side[1:] < 0.0)
    share = side[here] / (side[here] - side[here + 1])
    w = frequencies[here] + share * (frequencies[here + 1] - frequencies[here])
    # at -1/2 + j y its phase is pi - 2 atan(2 y), from 0 to 2 pi
    y = T.imag[here] + share * (T.imag[here + 1] - T.imag[here])
    least = float(((math.pi - 2.0 * np.arctan(2.0 * y)) / w).min(initial=math.inf))
    return least if least <= longest else math.inf


LOWEST = 0.02
"""Lowest frequency (rad/s) of a grid; no loop of a vehicle is slower than a minute."""

DECADE = 32
"""Frequencies of the grid per decade, in addition to those around each resonance."""

AROUND = (-4.0, -2.0, -1.0, -0.5, -0.2, 0.0, 0.2, 0.5, 1.0, 2.0, 4.0)
"""Frequencies around a resonance, in units of half its width at half its height."""

WIDE = 0.5
"""Half-width of a resonance over its frequency above which the even grid, 7 per cent
wide, resolves it."""

DEAD = 1e-2
"""Largest magnitude of an eigenvalue without a resonance; it decays within three
periods."""

AT_ONCE = 96
"""Number of frequencies whose systems are solved together, about ten megabytes."""


def frequency_grid(z: Complex, period: float) -> Array:
    """Frequency grid (rad/s), ascending up to Nyquist, refined around the resonances of
    the eigenvalues.

    Args:
        z: eigenvalues per control period.
        period: s.
    """
    highest = np.pi / period
    even = np.geomspace(
        LOWEST, highest, max(2, round(DECADE * np.log10(highest / LOWEST)) + 1)
    )
    s = np.log(z[np.abs(z) > DEAD].astype(complex)) / period
    # of conjugate eigenvalues one is enough
    s = s[(s.imag > 0.0) & (np.abs(s.real) < WIDE * s.imag)]
    # an undamped resonance would have all its frequencies at one
    around = s.imag[:, None] + np.maximum(np.abs(s.real), 1e-6)[:, None] * np.array(
        AROUND
    )
    grid = np.unique(np.concatenate([even, around.ravel()]))
    return grid[(grid >= LOWEST) & (grid <= highest)]


@positional(eq=False)
class Response:
    """Frequency response ``C (z - A)^-1 B`` of x+ = A x + B v, y = C x; period in s,
    z = exp(i w period).
    """

    A: Array
    B: Array
    C: Array
    period: float

    def at(self, frequencies: Array) -> Complex:
        """Responses (frequencies, outputs, inputs) at frequencies in rad/s."""
        z = np.exp(1j * doubles(frequencies) * self.period)[:, None, None]
        responses = np.zeros((len(z), len(self.C), self.B.shape[1]), dtype=complex)
        for k in range(0, len(z), AT_ONCE):
            some = slice(k, k + AT_ONCE)
            responses[some] = self.C @ np.linalg.solve(
                z[some] * np.eye(len(self.A)) - self.A, self.B
            )
        return responses


ROUNDS = 30
"""Iterations of the power method for Perron's vectors."""

STEPS = 60
"""Largest number of descent steps of one frequency's bound; the descent ends where a
step gains less than ``ENOUGH``."""

ENOUGH = 2e-4
"""Least relative gain of a descent step."""

CLOSE = 2e-3
"""Excess of the largest bound over the largest descended one below which the result is
accepted."""

SMALLEST = 1e-12
"""Fraction of the largest entry added to a matrix, which makes Perron's vectors
positive."""


def upper_bound(M: Complex) -> Array:
    """Upper bounds of the structured singular values of matrices (count, n, n); tight
    for the largest one.

    Others are bounds, too, though looser ones than they could be.
    """
    if M.shape[1] == 1:
        return np.abs(M[:, 0, 0])
    scaled = _perron_scaled(M)
    bounds = np.linalg.norm(scaled, ord=2, axis=(1, 2))
    lowest = 0.0
    # only the largest bound counts: others are lowered while they exceed it
    while len(bounds) and bounds.max() > lowest * (1.0 + CLOSE):
        worst = int(np.argmax(bounds))
        bounds[worst] = min(bounds[worst], _descend(scaled[worst]))
        lowest = max(lowest, float(bounds[worst]))
    return np.asarray(bounds)


def _perron_scaled(M: Complex) -> Complex:
    """Perron scaling D M D^-1, D the root of the left over the right Perron vector of
    |M|.
    """
    size = np.abs(M)
    # a zero matrix gets positive entries as well
    size = size + SMALLEST * size.max(axis=(1, 2), keepdims=True, initial=1e-300)
    right, left = np.ones(M.shape[:2]), np.ones(M.shape[:2])
    for _ in range(ROUNDS):
        right = np.einsum("fij,fj->fi", size, right)
        left = np.einsum("fij,fi->fj", size, left)
        right, left = (v / v.max(axis=1, keepdims=True) for v in (right, left))
    d = np.sqrt(left / right)
    return d[:, :, None] * M / d[:, None, :]


def _descend(M: Complex) -> float:
    """Least of the largest singular value over diagonal scalings D M D^-1, by gradient
    descent.
    """
    value, slope = _slope(M)
    # steps are chosen: any scaling gives an upper bound, a better one a lower bound
    step = 0.5
    for _ in range(STEPS):
        if step < 1e-3 or not norm(slope) > 0.0:
            break
        d = np.exp(-step * slope / norm(slope))
        moved = d[:, None] * M / d[None, :]
        lower, its_slope = _slope(moved)
        if lower < value * (1.0 - ENOUGH):
            M = moved
            value = lower
            slope = its_slope
            step = 1.5 * step
        else:
            step *= 0.5
    return value


def _slope(M: Complex) -> tuple[float, Array]:
    """Largest singular value of a matrix, and its gradient in the logarithms of the
    scaling's diagonal.
    """
    U, sizes, Vh = np.linalg.svd(M)
    return float(sizes[0]), sizes[0] * (np.abs(U[:, 0]) ** 2 - np.abs(Vh[0]) ** 2)


BETWEEN = 8
"""Number of frequencies evaluated on either side of the most critical one of the
grid."""

ALL = {COMMANDS: "all commands", MEASUREMENTS: "all measurements"}
"""Port -> name of all its channels cut at once."""


@dataclass(eq=False)
class CutLoops:
    """Closed-loop frequency responses from an injection at each channel to every
    channel.

    Attributes:
        ports: for each port, its channels, frequencies (rad/s) and responses
            (frequencies, channels, channels), and what gives them at other frequencies.
        stable: an unstable loop has no margins.
    """

    ports: dict[str, _Port]
    stable: bool

    def loops(self, longest: float) -> tuple[LoopMargin, ...]:
        """Disk and delay margin of every channel separately; delays up to ``longest``,
        s.
        """
        return tuple(
            each
            for name, port in self.ports.items()
            for each in port.alone(name, longest, self.stable)
        )

    def together(self) -> tuple[LoopMargin, ...]:
        """Simultaneous disk margins of each channel group, of all commands and of all
        measurements.
        """
        margins: list[LoopMargin] = []
        for name, port in self.ports.items():
            groups = {
                group: port.places(group)
                for group in dict.fromkeys(c.group for c in port.channels)
            }
            # pushes are rotors once more
            groups[ALL[name]] = [
                i for i, c in enumerate(port.channels) if c.group != "pushes"
            ]
            for group, places in groups.items():
                if len(places) > 1:
                    disk, w = (
                        port.disk_of_several(places) if self.stable else (0.0, math.nan)
                    )
                    margins.append(
                        LoopMargin(
                            name=group,
                            group=group,
                            port=name,
                            channels=len(places),
                            disk=disk,
                            frequency=w,
                        )
                    )
        return tuple(margins)


@dataclass(slots=True, eq=False)
class _Port:
    """Commands or measurements at which the loop is cut, with their closed-loop
    frequency responses.
    """

    channels: tuple[LoopChannel, ...]
    frequencies: Array
    T: Complex
    response: Response

    def places(self, group: str) -> list[int]:
        """Indices of the channels of one kind, such as all rotors."""
        return [i for i, channel in enumerate(self.channels) if channel.group == group]

    def alone(self, port: str, longest: float, stable: bool) -> list[LoopMargin]:
        """Disk and delay margin of each channel, cut alone."""
        # S is 1 + T, so that S - 1/2 is T + 1/2
        sizes = np.abs(np.diagonal(self.T, axis1=1, axis2=2) + 0.5)
        margins = []
        for i, channel in enumerate(self.channels):
            # an unstable loop has no frequencies: its responses would mean nothing
            k = int(np.argmax(sizes[:, i])) if len(sizes) else 0
            margins.append(
                LoopMargin(
                    name=channel.name,
                    group=channel.group,
                    port=port,
                    disk=disk_of(sizes[k, i]) if stable else 0.0,
                    frequency=float(self.frequencies[k]) if stable else math.nan,
                    delay=(
                        delay_of(self.T[:, i, i], self.frequencies, longest)
                        if stable
                        else 0.0
                    ),
                )
            )
        return margins

    def disk_of_several(self, places: Sequence[int]) -> tuple[float, float]:
        """Simultaneous disk margin of several channels, and the frequency of its
        minimum.
        """
        part = self.T[:, places][:, :, places] + 0.5 * np.eye(len(places))
        sizes = upper_bound(part)
        k = int(np.argmax(sizes))
        return disk_of(float(sizes[k])), float(self.frequencies[k])


def cut_loops(
    loop: OpenLoop, as_it_is: Closed, z: Complex, *, measured: bool, stable: bool
) -> CutLoops:
    """Compute the closed-loop frequency responses between all commands and between all
    measurements.

    Args:
        loop: linearised.
        as_it_is: the same closed.
        z: eigenvalues of the closed loop.
        measured: cut it at the measurement, too.
        stable: whether it is stable; of an unstable one nothing is computed.
    """
    A = as_it_is.matrix(gains(loop))
    # what is added to the measurement moves the law's memory, and its commands at once
    into = {
        COMMANDS: as_it_is.enters,
        MEASUREMENTS: as_it_is.shown + as_it_is.enters @ as_it_is.answered,
    }
    out = {COMMANDS: as_it_is.sent, MEASUREMENTS: as_it_is.seen}
    grid = frequency_grid(z, loop.period) if stable else np.zeros(0)
    ports = {}
    for port in (COMMANDS, MEASUREMENTS) if measured else (COMMANDS,):
        mine = [c for c in loop.channels if c.port == port]
        B = np.column_stack(
            [np.zeros((len(A), 0)), *(into[port] @ c.enters for c in mine)]
        )
        C = np.array([c.reads @ out[port] for c in mine]).reshape(-1, len(A))
        # what nothing is made of is no loop
        used = [
            i
            for i in range(len(C))
            if port == COMMANDS or (B[:, i].any() and C[i].any())
        ]
        response = Response(A, B[:, used], C[used], loop.period)
        ports[port] = _Port(
            tuple(mine[i] for i in used), *_refine(response, grid), response
        )
    return CutLoops(ports, stable)


def _refine(response: Response, grid: Array) -> tuple[Array, Complex]:
    """Refine a frequency grid around each channel's critical frequency; returns grid
    and frequency responses.
    """
    T = response.at(grid)
    if not T.size:
        return grid, T
    critical = np.argmax(np.abs(np.diagonal(T, axis1=1, axis2=2) + 0.5), axis=0)
    low = grid[np.maximum(critical - 1, 0)]
    high = grid[np.minimum(critical + 1, len(grid) - 1)]
    # channels of one critical frequency share those around it
    added = np.setdiff1d(np.linspace(low, high, 2 * BETWEEN + 1)[1:-1], grid)
    every = np.concatenate([grid, added])
    order = np.argsort(every)
    return every[order], np.concatenate([T, response.at(added)])[order]
