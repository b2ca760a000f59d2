"""What is tight in a plan: a summary for people and programs, and the scenario that flies the plan."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from skyarm.algebra import Quaternion
from skyarm.planning.planner import Plan
from skyarm.records.arrays import Array
from skyarm.records.files.toml import toml_value
from skyarm.records.immutable import immutable


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
class Summary:
    """Numbers of a plan.

    Attributes:
        duration: s. phases: their names and lengths, s. speed: largest of the base, m/s. tilt: largest, rad.
        rotor, torque, joint_rate: what is nearest to its limit. clearance: smallest distance, m; between which bodies.
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
    violation: float
    cost: float
    seconds: float
    seeds: int
    iterations: int


def summary(plan: Plan) -> Summary:
    """Numbers of a plan: lengths, peaks, what is tight, clearance, and what it cost to find."""
    vehicle, task = plan.task.vehicle, plan.task
    n, m = vehicle.n, len(vehicle.rotors)
    R = Quaternion(*plan.x[:, 3:7].T).rotation()
    tilt = np.arccos(np.clip(np.broadcast_to(R.rows[2].z, len(plan.t)), -1.0, 1.0))
    most = np.array([float(rotor.max_speed) for rotor in vehicle.rotors])
    speeds = plan.x[:, 13 + 2 * n : 13 + 2 * n + m] * np.array(plan.stage.hover) / most
    efforts = np.array([float(link.joint.effort_limit) for link in vehicle.links])
    joints = [link.joint.name for link in vehicle.links]
    torque = rate = None
    if n:
        rate = _tightest(plan.t, np.abs(plan.x[:, 13 + n : 13 + 2 * n]) / task.limits.joint_rate, joints)
        torque = _tightest(plan.t[:-1], np.abs(plan.torques) / efforts, joints)
    names = [phase.name or phase.kind for phase in task.phases]
    gap = plan.nearest.gap if plan.nearest is not None else math.inf
    return Summary(
        duration=float(plan.t[-1]),
        phases=tuple(zip(names, np.diff(plan.t[list(plan.edges)]).tolist(), strict=True)),
        speed=float(np.linalg.norm(plan.x[:, 7:10], axis=1).max()),
        tilt=float(tilt.max()),
        rotor=_tightest(plan.t, speeds**2, [rotor.name for rotor in vehicle.rotors]),
        torque=torque,
        joint_rate=rate,
        clearance=gap if math.isfinite(gap) else None,
        nearest=plan.nearest.words if plan.nearest is not None else "",
        violation=plan.solution.violation,
        cost=plan.solution.cost,
        seconds=plan.seconds,
        seeds=plan.seeds,
        iterations=plan.solution.iterations,
    )


def _tightest(t: Array, shares: Array, names: list[str]) -> Tight:
    k, j = np.unravel_index(int(shares.argmax()), shares.shape)
    return Tight(name=names[int(j)], share=float(shares[k, j]), time=float(t[k]))


def summary_lines(name: str, found: Summary) -> list[str]:
    """Lines of text of a summary."""
    parts = ", ".join(f"{each} {length:.3g} s" for each, length in found.phases)
    lines = [f"{name}: {found.duration:.3f} s ({parts})"]
    lines.append(f"base: at most {found.speed:.2f} m/s, tilted by {math.degrees(found.tilt):.1f} degrees")
    for words, each in (("rotor thrust", found.rotor), ("joint torque", found.torque), ("joint rate", found.joint_rate)):
        if each is not None:
            lines.append(f"{words}: at most {100.0 * each.share:.0f} % of the limit, {each.name} at {each.time:.2f} s")
    if found.clearance is not None:
        lines.append(f"clearance: {found.clearance:.3f} m, {found.nearest}")
    seeds = f"{found.seeds} seed{'s' if found.seeds > 1 else ''}"
    lines.append(f"found in {found.seconds:.2f} s, {seeds}; violation {found.violation:.1e}")
    return lines


SETTLE = 1.0
"""Time (s) of hover before a plan begins and after it ends, in the scenario that flies it."""


def flight_text(plan: Plan, file: Path, vehicle: str) -> str:
    """Scenario file that flies a plan by the centroidal law.

    Args:
        plan: the plan. file: its file, as the scenario names it. vehicle: name or path of the vehicle.
    """
    tilt = summary(plan).tilt
    lines = [
        f"# Flies the plan {file.name} of skyarm plan.",
        "schema = 1",
        f"name = {toml_value(plan.task.name)}",
        f"duration = {plan.t[-1] + 2.0 * SETTLE:.6g}",
        "",
        "[rates]",
        "control = 200                # Hz",
        "reference = 200              # Hz: the plan is known on board",
        "",
        "[plant]",
        f"vehicle = {toml_value(vehicle)}",
        *([f"gravity = {plan.task.gravity:g}"] if plan.task.gravity != 9.81 else []),
        "",
        "[controller]",
        'law = "centroidal"',
        'mode = "joint"',
        "bandwidth = 1.0",
        f"tilt = {max(1.2, 1.5 * math.tan(min(tilt + 0.1, 1.4))):.3g}                   # tangent of the largest tilt",
        "",
        "[reference]",
        'kind = "plan"',
        f"file = {toml_value(str(file))}",
        f"start = {SETTLE:g}                  # s",
        "",
    ]
    for each in plan.task.obstacles:
        lines += ["[[world.surfaces]]", f"name = {toml_value(each.name)}", f"shape = {toml_value(each.shape)}"]
        for word in ("size", "position", "angles"):
            lines.append(f"{word} = {toml_value([float(c) for c in getattr(each, word)])}")
        lines.append("")
    return "\n".join(lines)

