"""What pressing on a surface asks of the rest of the law, and what it puts in place of the observed force.

The joints give the order along the normal in place of what is observed there, by the levers of the present. The base
carries the order and, while its ramp runs, what is felt beyond it: an impact pushes the base back with more than the
order of that instant, and a base that does not answer this swings.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from skyarm.algebra import Vec3
from skyarm.control.blocks.disturbance import Disturbance
from skyarm.control.laws.centroidal.tip_force import TipLevers
from skyarm.control.laws.centroidal.tip_reference import Goal
from skyarm.scalars import add, mul, sub
from skyarm.scalars.taylor import Taylor


@dataclass(frozen=True, kw_only=True, slots=True)
class Pressing:
    """What an instant asks of the rest of the law.

    Attributes:
        n: out of the surface. share: 0 free, 1 pressing. damping: 1/s, of the tip along n where it presses.
        engaged: 1 while the order stands in place of the observed force. shift: m, m/s and m/s^2 along n.
        order: N, along n, in place of the observed one. beyond: N, that the base carries along n beside it.
        force: N, the tip's as observed, world axes.
        kept: 0 to 1, of the observed force across n that is answered. asked: whether any contact is asked for.
    """

    n: Vec3
    share: Any
    damping: Any
    engaged: Any
    shift: tuple[Any, Any, Any]
    order: Any
    beyond: Any
    force: Vec3
    kept: Any
    asked: Any = False

    def shifted(self, signals: Sequence[Taylor]) -> list[Taylor]:
        """The reference's signals with x, y and z moved along the normal."""
        s = Taylor((self.shift[0], self.shift[1], mul(0.5, self.shift[2]), 0.0, 0.0))
        return [*(each + s * c for each, c in zip(signals[:3], self.n, strict=True)), *signals[3:]]

    def exchanged(self, d: Disturbance, then: TipLevers, now: TipLevers) -> Disturbance:
        """The disturbance with the order in place of what the observer holds along n, by the levers of the present.

        The joints give the order, and yield to all else; the base carries what is still felt beyond it, too.
        """
        across = self.force - self.n * self.n.dot(self.force)
        wanted = across * self.kept + self.n * self.order
        borne = wanted + self.n * self.beyond
        held, given, base = then.disturbance(self.force), now.disturbance(wanted), now.disturbance(borne)
        return Disturbance(
            force=d.force + (base.force - held.force) * self.engaged,
            torque=d.torque + (base.torque - held.torque) * self.engaged,
            efforts=tuple(
                add(e, mul(sub(g, h), self.engaged))
                for e, g, h in zip(d.efforts, given.efforts, held.efforts, strict=True)
            ),
        )

    def freed(self, goal: Goal, tip: Vec3, tip_velocity: Vec3, velocity_gain: Any) -> Goal:
        """The tip's goal without a position along n: by the gains on it a_n = -damping v_n is left there."""
        p, v, a = goal.tip
        n, slower = self.n, 1.0 - self.damping / velocity_gain
        return dataclasses.replace(
            goal,
            tip=(
                p + n * (n.dot(tip - p) * self.share),
                v + n * (n.dot(tip_velocity * slower - v) * self.share),
                a - n * (n.dot(a) * self.share),
            ),
        )
