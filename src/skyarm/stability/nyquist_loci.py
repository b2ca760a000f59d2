"""Loci of the loops in hover, cut one at a time: what a Nyquist diagram shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from skyarm.scenario.scenario_record import Scenario
from skyarm.stability.along import frozen_instants, hovering
from skyarm.stability.closed_loop import closed, gains
from skyarm.stability.cut_loops import cut_loops
from skyarm.stability.frozen_scenario import nominal, without_adaptation
from skyarm.stability.loop_derivatives import OpenLoop
from skyarm.stability.loop_margin import LoopMargin
from skyarm.stability.margins import EDGE, LONGEST

Complex = npt.NDArray[np.complex128]

POINTS = 500
"""Further frequencies, so that a curve looks like one."""


@dataclass(frozen=True, slots=True, eq=False)
class Locus:
    """One loop of those that are cut.

    Attributes:
        margin: its disk margin. L: its open-loop response under negative feedback, by ascending frequency.
    """

    margin: LoopMargin
    L: Complex


def hover_loci(scenario: Scenario) -> list[Locus]:
    """The weakest loop of each kind in hover, with the rotors' time constant downward; none where it is lost."""
    found = next(frozen_instants(hovering(nominal(without_adaptation(scenario))), 1), None)
    return [] if found is None else loci(found.opened("down"))


def loci(loop: OpenLoop) -> list[Locus]:
    """The weakest loop of each kind; none of an unstable one.

    With T from what is added to a channel to the channel itself, closed, the loop under negative feedback is
    -T / (1 + T).
    """
    as_it_is = closed(loop)
    z = np.linalg.eigvals(as_it_is.matrix(gains(loop))).astype(complex)
    if np.abs(z).max(initial=0.0) > EDGE:
        return []
    cut = cut_loops(loop, as_it_is, z, measured=True, stable=True)
    weakest: dict[tuple[str, str], Locus] = {}
    for name, port in cut.ports.items():
        even = np.geomspace(port.frequencies[0], port.frequencies[-1], POINTS)
        every = port.at(np.union1d(port.frequencies, even))
        for i, margin in enumerate(port.alone(name, LONGEST, stable=True)):
            T = every[:, i, i]
            key = (name, margin.group)
            if key not in weakest or margin.disk < weakest[key].margin.disk:
                weakest[key] = Locus(margin, -T / (1.0 + T))
    return list(weakest.values())
