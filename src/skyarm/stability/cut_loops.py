"""A closed loop cut at its channels: responses at all frequencies, and the margins that are read from them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from skyarm.stability.closed_loop import Closed, gains
from skyarm.stability.frequency_response import Response, frequency_grid, response
from skyarm.stability.gain_edges import gain_edges
from skyarm.stability.loop_channels import COMMANDS, MEASUREMENTS, Channel, numbered_channels
from skyarm.stability.loop_derivatives import OpenLoop
from skyarm.stability.loop_margin import LoopMargin, delay_of, disk_of
from skyarm.stability.structured_bound import upper_bound

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

BETWEEN = 8
"""Frequencies that are looked at on either side of the most delicate one of the grid."""

ALL = {COMMANDS: "all commands", MEASUREMENTS: "all measurements"}
"""Names of what is cut at once at a port."""


@dataclass(slots=True, eq=False)
class CutLoops:
    """Responses of a closed loop from what is added to each channel to each channel.

    Attributes:
        ports: of each port its channels, frequencies (rad/s) and responses (frequencies, channels, channels), and what
            gives them at other frequencies.
        period: s. stable: an unstable loop has no margins.
    """

    ports: dict[str, _Port]
    period: float
    stable: bool
    _edges: dict[tuple[int, ...], Array] = field(default_factory=dict)

    def loops(self, longest: float) -> tuple[LoopMargin, ...]:
        """Disk and delay margin of every channel alone; delays up to ``longest``, s."""
        return tuple(each for name, port in self.ports.items() for each in port.alone(name, longest, self.stable))

    def together(self) -> tuple[LoopMargin, ...]:
        """Disk margin of every group of two and more channels, and of all commands and of all measurements."""
        found: list[LoopMargin] = []
        for name, port in self.ports.items():
            groups = {group: port.places(group) for group in dict.fromkeys(c.group for c in port.channels)}
            # pushes are rotors once more
            groups[ALL[name]] = [i for i, c in enumerate(port.channels) if c.group != "pushes"]
            for group, places in groups.items():
                if len(places) > 1:
                    disk, w = port.disk_of_several(places) if self.stable else (0.0, math.nan)
                    found.append(
                        LoopMargin(name=group, group=group, port=name, channels=len(places), disk=disk, frequency=w)
                    )
        return tuple(found)

    def gain_edges(self, places: Sequence[int]) -> Array:
        """Gains, but 1, of some commands with which the loop is on the edge of stability, ascending."""
        if not self._edges:
            self._find_edges()
        return self._edges[tuple(places)]

    def _find_edges(self) -> None:
        port = self.ports[COMMANDS]
        rotors, joints = port.places("rotors"), port.places("joints")
        blocks: list[tuple[int, ...]] = [(i,) for i in (*rotors, *joints)]
        of_channel = {i: k for k, i in enumerate((*rotors, *joints))}
        blocks += [block for block in (tuple(rotors), tuple(joints)) if len(block) > 1]
        found = gain_edges(port.T, port.frequencies, blocks, port.at, self.period)
        for block, edges in zip(blocks, found, strict=True):
            self._edges[tuple(of_channel[i] for i in block)] = edges


@dataclass(slots=True, eq=False)
class _Port:
    """Channels of one port with their responses."""

    channels: tuple[Channel, ...]
    frequencies: Array
    T: Complex
    response: Response

    def at(self, frequencies: Array) -> Complex:
        """Responses at other frequencies, rad/s."""
        return self.response.at(frequencies)

    def places(self, group: str) -> list[int]:
        """Numbers of a group's channels."""
        return [i for i, channel in enumerate(self.channels) if channel.group == group]

    def alone(self, port: str, longest: float, stable: bool) -> list[LoopMargin]:
        """Margins of each channel."""
        sizes = np.abs(np.diagonal(self.T, axis1=1, axis2=2) + 0.5)
        found = []
        for i, channel in enumerate(self.channels):
            k = int(np.argmax(sizes[:, i])) if len(sizes) else 0
            found.append(
                LoopMargin(
                    name=channel.name,
                    group=channel.group,
                    port=port,
                    disk=disk_of(sizes[k, i]) if stable else 0.0,
                    frequency=float(self.frequencies[k]) if stable else math.nan,
                    delay=delay_of(self.T[:, i, i], self.frequencies, longest) if stable else 0.0,
                )
            )
        return found

    def disk_of_several(self, places: Sequence[int]) -> tuple[float, float]:
        """Disk margin of channels under factors of their own, and the frequency where they bear least."""
        part = self.T[:, places][:, :, places] + 0.5 * np.eye(len(places))
        sizes = upper_bound(part)
        k = int(np.argmax(sizes))
        return disk_of(float(sizes[k])), float(self.frequencies[k])


def cut_loops(loop: OpenLoop, as_it_is: Closed, z: Complex, *, measured: bool, stable: bool) -> CutLoops:
    """Responses of a loop between its channels.

    Args:
        loop: linearised.
        as_it_is: the same closed.
        z: its eigenvalues.
        measured: cut it at the measurement, too.
        stable: of an unstable one nothing is computed.
    """
    sizes = (loop.rotors, loop.u_m.shape[0] - loop.rotors, len(loop.y_x))
    channels = loop.channels or numbered_channels(*sizes)
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
        B = np.column_stack([np.zeros((len(A), 0)), *(into[port] @ c.enters for c in channels if c.port == port)])
        C = np.array([c.reads @ out[port] for c in channels if c.port == port]).reshape(-1, len(A))
        # what nothing is made of is no loop
        kept = [i for i in range(len(C)) if port == COMMANDS or (B[:, i].any() and C[i].any())]
        mine = [c for c in channels if c.port == port]
        found = response(A, B[:, kept], C[kept], loop.period)
        ports[port] = _Port(tuple(mine[i] for i in kept), *_sharpened(found, grid), found)
    return CutLoops(ports, loop.period, stable)


def _sharpened(found: Response, grid: Array) -> tuple[Array, Complex]:
    """A grid with more frequencies around the most delicate one of each channel, and the responses there."""
    T = found.at(grid)
    if not T.size:
        return grid, T
    more = []
    for k in sorted({int(k) for k in np.argmax(np.abs(np.diagonal(T, axis1=1, axis2=2) + 0.5), axis=0)}):
        low, high = grid[max(k - 1, 0)], grid[min(k + 1, len(grid) - 1)]
        more.append(np.linspace(low, high, 2 * BETWEEN + 1)[1:-1])
    added = np.setdiff1d(np.concatenate(more), grid)
    order = np.argsort(np.concatenate([grid, added]))
    return np.concatenate([grid, added])[order], np.concatenate([T, found.at(added)])[order]
