"""``[[payloads]]`` of a scenario file: loads that are picked up and set down in flight.

::

    [[payloads]]
    name = "parcel"                                  # default: its number
    mass = 0.3                                       # kg
    inertia = [1e-4, 1e-4, 1e-4]                     # kg m^2, about its centre of mass, axes of the frame (default 0)
    com = [0, 0, -0.02]                              # m, axes of the frame (default 0)
    frame = "tip"                                    # default: the vehicle's tip
    pick = 8.0                                       # s, or
    pick = { within = 0.05, of = [1, 0, 0.5] }       # m, world axes: as soon as the frame is there; after (s, 0)
    drop = 14.0                                      # the same; left out: it is held to the end
    kind = "rigid"                                   # or "hanging", a point mass on a cord: cord (m, 0.5), stretch (by
                                                     # its weight, of its length, 0.02), damping_ratio (0.2)
    believed = true                                  # the law's belief is told at both instants (default false)

What is believed is a point mass at the frame, told by changes of ``model.payload.FRAME.mass``
(:mod:`skyarm.scenario.in_flight`).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

from skyarm.algebra import Vec3
from skyarm.environment import HangingPayload, Reach, TimedPayload
from skyarm.files import Fields, shown
from skyarm.reference import Trajectory
from skyarm.scenario.changes import Change

OF_KIND = {"rigid": ("inertia", "com"), "hanging": ("cord", "stretch", "damping_ratio")}
"""Numbers of a payload that others have not."""


def payloads_from(tables: Any, where: str = "payloads") -> tuple[tuple[TimedPayload, ...], tuple[bool, ...]]:
    """(payloads that a list of tables describes, of which the law is told).

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    if not isinstance(tables, list):
        raise ValueError(f"{where} = {shown(tables)}: must be a list of tables")
    read = [_payload(Fields(table, f"{where}[{i}]")) for i, table in enumerate(tables)]
    return tuple(payload for payload, _ in read), tuple(told for _, told in read)


def _payload(fields: Fields) -> tuple[TimedPayload, bool]:
    texts = {name: fields.take(name, "") for name in ("name", "frame")}
    believed = fields.take("believed", False)
    if not isinstance(believed, bool):
        raise ValueError(f"{fields.at('believed')} = {shown(believed)}: must be true or false")
    values: dict[str, Any] = {"mass": fields.number("mass", low=0.0), **texts}
    kind = fields.choice("kind", ("rigid", "hanging"), "rigid")
    for name in OF_KIND[kind]:
        if name in fields.table:
            values[name] = fields.vector(name) if kind == "rigid" else fields.number(name, low=0.0)
    values["pick"], values["pick_place"] = _when(fields, "pick")
    values["drop"], values["drop_place"] = _when(fields, "drop") if "drop" in fields.table else (math.inf, None)
    fields.done()
    places = values["pick_place"] or values["drop_place"]
    if believed and places is not None:
        raise ValueError(f"{fields.at('believed')} = true: must be false where a place decides; its instant is unknown")
    try:
        return (HangingPayload if kind == "hanging" else TimedPayload)(**values), believed
    except ValueError as error:
        raise ValueError(f"{fields.where}: {error}") from None


def _when(fields: Fields, name: str) -> tuple[float, Reach | None]:
    """An instant, or a place with the earliest instant."""
    if not isinstance(fields.table.get(name), dict):
        return fields.number(name, low=0.0), None
    inner = Fields(fields.take(name), fields.at(name))
    reach = Reach(within=inner.number("within", low=0.0, strict=True), of=Vec3(*inner.vector("of")))
    after = inner.number("after", 0.0, low=0.0)
    inner.done()
    return after, reach


def waiting_beliefs(
    payloads: Sequence[TimedPayload], told: Sequence[bool], trajectory: Trajectory
) -> tuple[tuple[TimedPayload, ...], tuple[bool, ...]]:
    """The payloads of a task that waits say themselves whether the law is told: no instant is known; and the rest."""
    waiting = {name for guard in trajectory.guards for name in guard.loads}
    now = tuple(
        dataclasses.replace(each, believed=True) if told_of and each.name in waiting else each
        for each, told_of in zip(payloads, told, strict=True)
    )
    return now, tuple(told_of and not each.believed for each, told_of in zip(now, told, strict=True))


def belief_changes(
    payloads: Sequence[TimedPayload], told: Sequence[bool], duration: float, rate: int
) -> tuple[Change, ...]:
    """Changes that tell the law's belief the mass that is held at each frame, as it changes.

    Args:
        payloads: of the flight.
        told: of which of them the law is told.
        duration: of the flight, s; what comes behind its end is left out.
        rate: of control, Hz.
    """
    known = [payload for payload, believed in zip(payloads, told, strict=True) if believed]
    found: list[Change] = []
    for frame in dict.fromkeys(payload.frame for payload in known):
        here = [payload for payload in known if payload.frame == frame]
        path = f"model.payload.{frame}.mass" if frame else "model.payload.mass"
        instants = sorted({float(t) for each in here for t in (each.pick, each.drop) if math.isfinite(t)})
        for t in instants:
            mass = math.fsum(float(each.mass) for each in here if each.pick <= t < each.drop)
            found.append(Change(at=t, path=path, value=mass))
    steps = duration * rate  # of an absurd duration, which is refused later, infinity
    last = round(steps) if math.isfinite(steps) else steps
    return tuple(sorted((each for each in found if each.tick(rate) < last), key=lambda change: change.at))
