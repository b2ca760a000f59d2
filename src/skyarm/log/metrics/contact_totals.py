"""Running totals of a commanded contact, and of the objects moved by it, during an episode.

Forces are the sum of the normal forces at the vehicle's points. An instant counts while the reference asks for contact
(its force is above 0): for losses from 0.3 s after the first touch on, for the statistics of the force from 2 s after
it on, when the impact is over. What is moved is the first object and the first mechanism of the world, where the flight
leaves them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from skyarm.algebra.scalars import Scalar, absolute, logical_and, maximum, where
from skyarm.log.metrics import grip_totals
from skyarm.log.metrics.metric import Metric

if TYPE_CHECKING:
    from skyarm.log.metrics.accumulate import Instant

BOUNCES = 0.3
"""s after the first touch in which a loss of contact belongs to the impact."""

SETTLED = 2.0
"""s after the first touch from which on the force is held against the wanted one."""

BAND = 0.3
"""Share of the wanted force within which a force counts as held."""

NOT_YET = 1e30
"""s, of what has not happened."""


@dataclass(frozen=True, kw_only=True, slots=True)
class PushMemory:
    """Totals of a commanded contact so far.

    Attributes:
        first: s, of the first touch while contact is asked for. touching: 1 while a point is touched.
        losses: how often contact was lost. peak: N. count: instants of the force's statistics.
        error, square: sums of the force's error, N, and of its square. held: instants within the band.
        apart, farthest: sum and largest of the tip's error across the normal, m. near: instants in that sum.
    """

    first: Scalar = NOT_YET
    touching: Scalar = 0.0
    losses: Scalar = 0.0
    peak: Scalar = 0.0
    count: Scalar = 0.0
    error: Scalar = 0.0
    square: Scalar = 0.0
    held: Scalar = 0.0
    apart: Scalar = 0.0
    farthest: Scalar = 0.0
    near: Scalar = 0.0


@dataclass(frozen=True, slots=True)
class PushTotals(Metric):
    """Force, losses and the tip's error of a commanded contact; nothing is counted where none is commanded."""

    def start(self) -> PushMemory:
        """Totals before any contact."""
        return PushMemory()

    def count(self, memory: PushMemory, now: Instant) -> PushMemory:
        """Totals with one more instant; those of a flight without contact stay as they are."""
        if not now.push or not now.contact:
            return memory
        wanted, normal = now.push[0], now.push[2:5]
        force = _sum(now.contact)
        asked, touches = wanted > 0.0, force > 0.0
        begins = logical_and(logical_and(asked, touches), memory.first >= NOT_YET)
        first = where(begins, now.time, memory.first)
        after = now.time - first
        lost = logical_and(logical_and(asked, memory.touching > 0.5), logical_and(force <= 0.0, after >= BOUNCES))
        settled = logical_and(asked, after >= SETTLED)
        error = force - wanted
        held = logical_and(settled, absolute(error) <= BAND * wanted)
        apart = _across(now, normal)
        near = logical_and(asked, after >= 0.0)
        return PushMemory(
            first=first,
            touching=where(touches, 1.0, 0.0),
            losses=memory.losses + where(lost, 1.0, 0.0),
            peak=maximum(memory.peak, where(asked, force, 0.0)),
            count=memory.count + where(settled, 1.0, 0.0),
            error=memory.error + where(settled, error, 0.0),
            square=memory.square + where(settled, error * error, 0.0),
            held=memory.held + where(held, 1.0, 0.0),
            apart=memory.apart + where(near, apart, 0.0),
            farthest=maximum(memory.farthest, where(near, apart, 0.0)),
            near=memory.near + where(near, 1.0, 0.0),
        )


@dataclass(frozen=True, kw_only=True, slots=True)
class LeftMemory:
    """Latest and largest displacement of moved objects.

    Attributes:
        x, y, z: m, of the first object. mechanism, furthest: rad or m, of the first mechanism. force: N, at all points.
        lowest: m, height of the tip. phase: number of the last phase that began, and when: s.
        largest: N, at all points at any time.
    """

    x: Scalar = NOT_YET
    y: Scalar = NOT_YET
    z: Scalar = NOT_YET
    mechanism: Scalar = NOT_YET
    furthest: Scalar = -NOT_YET
    force: Scalar = NOT_YET
    lowest: Scalar = NOT_YET
    phase: Scalar = 0.0
    when: Scalar = 0.0
    largest: Scalar = -NOT_YET


@dataclass(frozen=True, slots=True)
class LeftTotals(Metric):
    """Final displacement of moved objects, and the time at which the task was done."""

    def start(self) -> LeftMemory:
        """Totals before any motion of an object."""
        return LeftMemory()

    def count(self, memory: LeftMemory, now: Instant) -> LeftMemory:
        """With one more instant."""
        x, y, z = now.objects[:3] if now.objects else (memory.x, memory.y, memory.z)
        moved = now.mechanisms[0] if now.mechanisms else memory.mechanism
        force = _sum(now.contact) if now.contact else memory.force
        more = now.phase > memory.phase
        return LeftMemory(
            x=x, y=y, z=z, mechanism=moved,
            furthest=maximum(memory.furthest, moved) if now.mechanisms else memory.furthest,
            force=force,
            lowest=where(now.tool.z < memory.lowest, now.tool.z, memory.lowest),
            phase=where(more, now.phase, memory.phase),
            when=where(more, now.time, memory.when),
            largest=maximum(memory.largest, force) if now.contact else memory.largest,
        )  # fmt: skip


def _sum(forces: tuple[Any, ...]) -> Any:
    total = forces[0]
    for force in forces[1:]:
        total = total + force
    return total


def _across(now: Instant, normal: tuple[Any, ...]) -> Any:
    """Distance of the tip from its reference across the model's normal, m."""
    away = now.tool - now.held.tool
    along = away.x * normal[0] + away.y * normal[1] + away.z * normal[2]
    return type(away)(*(a - along * n for a, n in zip(away, normal, strict=True))).norm()


SHIPPED: Mapping[str, Metric] = {
    "push": PushTotals(),
    "left": LeftTotals(),
    "grip": grip_totals.GripTotals(),
}
"""Totals by name, as those of registered metrics."""


def _share(total: Any, count: Any) -> Any:
    return np.where(np.asarray(count) > 0, np.asarray(total) / np.maximum(count, 1), np.nan)


def _ripple(held: Any) -> Any:
    mean = _share(held.error, held.count)
    return np.sqrt(np.maximum(_share(held.square, held.count) - mean * mean, 0.0))


def _met(held: Any, number: Any) -> Any:
    """A number of a contact, NaN where nothing was touched."""
    return np.where(np.asarray(held.first) < NOT_YET, number, np.nan)


def _nan_if_absent(number: Any) -> Any:
    """A number of what was moved, NaN where nothing of its kind is there."""
    return np.where(np.abs(number) < NOT_YET, number, np.nan)


VALUES: Mapping[str, tuple[str, Callable[[Any], Any], str, str]] = {
    "contact_error_mean": ("push", lambda held: _share(held.error, held.count), "mean error of the contact force", "N"),
    "contact_ripple": ("push", _ripple, "RMS of the contact force about its mean", "N"),
    "contact_held": (
        "push",
        lambda held: _share(held.held, held.count),
        "share of the time with the contact force within 30 % of the wanted one",
        "",
    ),
    "contact_peak": (
        "push",
        lambda held: _met(held, held.peak),
        "largest contact force while contact is asked for",
        "N",
    ),
    "contact_losses": ("push", lambda held: _met(held, held.losses), "losses of contact", "losses"),
    "contact_first": ("push", lambda held: _met(held, held.first), "first touch", "s"),
    "contact_tip_mean": (
        "push",
        lambda held: _share(held.apart, held.near),
        "mean tip error across the normal in contact",
        "m",
    ),
    "contact_tip_max": (
        "push",
        lambda held: _met(held, held.farthest),
        "largest tip error across the normal in contact",
        "m",
    ),
    "contact_last": ("left", lambda held: _nan_if_absent(held.force), "contact force at the end", "N"),
    "contact_largest": ("left", lambda held: _nan_if_absent(held.largest), "largest contact force", "N"),
    "object_last_x": ("left", lambda held: _nan_if_absent(held.x), "x of the first object at the end", "m"),
    "object_last_y": ("left", lambda held: _nan_if_absent(held.y), "y of the first object at the end", "m"),
    "object_last_z": ("left", lambda held: _nan_if_absent(held.z), "z of the first object at the end", "m"),
    "mechanism_last": (
        "left",
        lambda held: _nan_if_absent(held.mechanism),
        "coordinate of the first mechanism at the end",
        "",
    ),
    "mechanism_furthest": (
        "left",
        lambda held: _nan_if_absent(held.furthest),
        "largest coordinate of the first mechanism",
        "",
    ),
    "tip_lowest": ("left", lambda held: _nan_if_absent(held.lowest), "lowest height of the tip", "m"),
    "phases_time": ("left", lambda held: held.when, "when the last phase was done", "s"),
    **grip_totals.VALUES,
}
"""Metric -> the totals that it is made of, its value from them, its words and unit."""
