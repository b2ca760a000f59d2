"""Summary of a plan, and the scenario that flies it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from skyarm.algebra import Quaternion
from skyarm.planning.planner import Plan
from skyarm.records.arrays import Array, doubles, float_array, lengths
from skyarm.records.files.toml import Entry
from skyarm.records.immutable import immutable
from skyarm.records.read_table import entry_of
from skyarm.world.contact.surface import Surface


@immutable
class Tight:
    """Quantity of a plan nearest to its limit.

    Attributes:
        name: rotor or joint. share: largest share of its limit. time: when, s.
    """

    name: str
    share: float
    time: float


@immutable
class PlanSummary:
    """Numbers of a plan.

    Attributes:
        duration: s. phases: their names and lengths, s. speed: largest of the base,
            m/s. tilt: largest, rad.
        rotor, torque, joint_rate: what is nearest to its limit. clearance: smallest
            distance, m; between which bodies.
        short: which bodies come nearer than the task's clearance; empty if none.
        rotor_lag: largest lag of a rotor, over its speed in hover. fast: the phases
            where it is above the task's limit: of fixed duration, or free ones without
            a longer plan within the limits; empty if none.
        not_least: why the time is not the least, which was asked for; empty if it is.
        violation, cost, seconds, seeds, iterations: of the solution.
    """

    duration: float
    phases: tuple[tuple[str, float], ...]
    speed: float
    tilt: float
    rotor: Tight
    torque: Tight | None
    joint_rate: Tight | None
    clearance: float | None
    nearest: str
    short: str
    rotor_lag: float
    fast: str
    not_least: str
    violation: float
    cost: float
    seconds: float
    seeds: int
    iterations: int


def summary(plan: Plan) -> PlanSummary:
    """Numbers of a plan: lengths, peaks, what is tight, clearance, and what it cost to
    find.
    """
    vehicle, task = plan.task.vehicle, plan.task
    efforts = float_array(joint.effort_limit for joint in vehicle.joints)
    joints = vehicle.joint_names
    torque = rate = None
    if joints:
        rates = np.abs(plan.x[:, plan.stage.at.joint_rates])
        rate = _tightest(plan.t, rates / task.limits.joint_rate, joints)
        torque = _tightest(plan.t, np.abs(plan.torques) / efforts, joints)
    names = [phase.name or phase.kind for phase in task.phases]
    near = plan.nearest
    return PlanSummary(
        duration=float(plan.t[-1]),
        phases=tuple(zip(names, plan.durations, strict=True)),
        speed=float(lengths(plan.x[:, 7:10]).max()),
        tilt=float(tilts(plan).max()),
        rotor=_tightest(
            plan.t, plan.thrust_shares, tuple(rotor.name for rotor in vehicle.rotors)
        ),
        torque=torque,
        joint_rate=rate,
        clearance=near.gap if math.isfinite(near.gap) else None,
        nearest=near.bodies,
        short=f"{task.limits.clearance:g} m: {near.short}" if near.short else "",
        rotor_lag=float(plan.lags.max()),
        fast=", ".join(
            name
            for name, lag in zip(names, plan.lags, strict=True)
            if lag > task.limits.rotor_lag
        ),
        not_least=plan.not_least,
        violation=plan.solution.violation,
        cost=plan.solution.cost,
        seconds=plan.seconds,
        seeds=plan.seeds,
        iterations=plan.solution.iterations,
    )


def tilts(plan: Plan) -> Array:
    """Tilt (rad) of the base at the nodes of a plan."""
    up = Quaternion(*plan.x[:, 3:7].T).rotation().rows[2].z
    return np.asarray(np.arccos(np.clip(doubles(up), -1.0, 1.0)))


def _tightest(t: Array, shares: Array, names: tuple[str, ...]) -> Tight:
    k, j = np.unravel_index(int(shares.argmax()), shares.shape)
    return Tight(name=names[int(j)], share=float(shares[k, j]), time=float(t[k]))


def summary_lines(name: str, found: PlanSummary) -> list[str]:
    """Lines of text of a summary."""
    parts = ", ".join(f"{each} {length:.3g} s" for each, length in found.phases)
    lines = [
        f"{name}: {found.duration:.3f} s ({parts})",
        f"base: at most {found.speed:.2f} m/s, tilted by {math.degrees(found.tilt):.1f}"
        " degrees",
    ]
    for quantity, each in (
        ("rotor thrust", found.rotor),
        ("joint torque", found.torque),
        ("joint rate", found.joint_rate),
    ):
        if each is not None:
            lines.append(
                f"{quantity}: at most {100.0 * each.share:.0f} % of the limit,"
                f" {each.name} at {each.time:.2f} s"
            )
    if found.clearance is not None:
        lines.append(f"clearance: {found.clearance:.3f} m, {found.nearest}")
    if found.short:
        lines.append(f"nearer than limits.clearance = {found.short}")
    if found.not_least:
        lines.append(f"least time: {found.not_least}")
    if found.fast:
        lag = f"{found.rotor_lag:.2f} of their speed in hover"
        lines.append(
            f"fast: rotors lag by {lag} in {found.fast}, more than limits.rotor_lag:"
            " fly it first"
        )
    seeds = f"{found.seeds} seed{'s' if found.seeds > 1 else ''}"
    lines.append(
        f"found in {found.seconds:.2f} s, {seeds}; violation {found.violation:.1e}"
    )
    return lines


SETTLE = 1.0
"""Time (s) of hover before a plan begins and after it ends, in the scenario that flies
it; chosen: the law finds its trim first."""


LEANING = math.radians(75.0)
"""Largest tilt of a plan that the centroidal law follows: its heading is singular at 90
degrees, of which 15 are left to errors; chosen."""


def flight_document(plan: Plan, file: Path, vehicle: str) -> dict[str, Entry]:
    """Tables of a scenario that flies a plan in the task's world with its obstacles.

    The law is the centroidal one, or the predictive one where the base is tilted by
    more than :data:`LEANING`.

    Args:
        plan: the plan.
        file: its file, as the scenario names it.
        vehicle: name or path of the vehicle.
    """
    task, tilt = plan.task, summary(plan).tilt
    law: dict[str, Entry] = {"law": "nmpc", "mode": "plan"}
    if tilt <= LEANING:
        # the law limits the tangent: half more than planned, for errors, and below 1.4
        # rad, where the tangent grows without end; 1.2 is what the law has by default
        lean = round(max(1.2, 1.5 * math.tan(min(tilt + 0.1, 1.4))), 3)
        law = {"law": "centroidal", "mode": "joint", "bandwidth": 1.0, "tilt": lean}
    world: dict[str, Any] = dict(task.world or {})
    stated = [each.get("name") for each in world.get("surfaces", [])]
    # those of the task's world are in its table already
    own = [each for each in task.obstacles if each.name not in stated]
    if own:
        world["surfaces"] = [*world.get("surfaces", []), *map(_surface_row, own)]
    events = gripper_events(plan)
    world["grippers"] = [
        each | ({"closed": events[each["name"]]} if each.get("name") in events else {})
        for each in world.get("grippers", [])
    ]
    world = {name: entry for name, entry in world.items() if entry}
    # whole control periods; one that is whole but for rounding is not prolonged
    periods = math.ceil(200.0 * (float(plan.t[-1]) + 2.0 * SETTLE) - 1e-6)
    duration = periods / 200.0
    document: dict[str, Entry] = {
        "schema": 1,
        "name": task.name,
        "duration": duration,
        # the plan is known on board: its reference comes in each control period
        "rates": {"control": 200, "reference": 200},
        "plant": {"vehicle": vehicle, "gravity": task.gravity},
        "controller": law,
        # the planner knows obstacles and surfaces alone: a plan may lead below z = 0
        "environment": {"ground": False},
        "reference": {"kind": "plan", "file": str(file), "start": SETTLE},
    }
    return document | ({"world": world} if world else {})


def _surface_row(obstacle: Surface) -> dict[str, Entry]:
    """Table of an obstacle; keys whose values are the defaults are left out."""
    row: dict[str, Entry] = {"name": entry_of(obstacle.name)}
    for key in ("shape", "size", "position", "angles"):
        if value := getattr(obstacle, key):
            row[key] = entry_of(value)
    return row


def gripper_events(plan: Plan) -> dict[str, Entry]:
    """Commands of the grippers that the phases of a task close and open, as signals of
    the scenario's time.
    """
    times: dict[str, list[tuple[float, bool]]] = {}
    for phase, edge in zip(plan.task.phases, plan.edges[:-1], strict=True):
        at = SETTLE + float(plan.t[edge])
        for name, closes in ((phase.gripper, True), (phase.release, False)):
            if name:
                times.setdefault(name, []).append((at, closes))
    commands: dict[str, Entry] = {}
    for name, rows in times.items():
        pieces: list[Entry] = (
            # a gripper that opens first was closed before
            [] if rows[0][1] else [{"kind": "constant", "value": 1, "stop": rows[0][0]}]
        )
        for (at, closes), ends in zip(
            rows, [*(t for t, _ in rows[1:]), None], strict=True
        ):
            if closes:
                piece: dict[str, Entry] = {"kind": "constant", "value": 1, "start": at}
                pieces.append(piece if ends is None else piece | {"stop": ends})
        commands[name] = (
            {"kind": "sum", "signals": pieces} if len(pieces) > 1 else pieces[0]
        )
    return commands
