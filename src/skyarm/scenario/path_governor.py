"""A governor of a scenario's reference: it slows the path parameter where the believed vehicle could not follow.

The path stays as it is: no corner is cut. Errors are taken against the reference as it is commanded at each instant,
and the lag t - s(t) stands beside them. The plan is made before the flight, from what the law believes; the scenario
keeps it as a curve of time (:mod:`skyarm.reference.governor.path_time`), so that every engine flies the same numbers.
"""

from __future__ import annotations

import dataclasses
import math
import warnings
from collections.abc import Iterator
from typing import Any

from skyarm.actuation.motion_demand import Motion, motion_of
from skyarm.algebra import Vec3
from skyarm.files import Fields, shown
from skyarm.records.leaves import field_names
from skyarm.reference.governor.path_time import by_flight_time
from skyarm.reference.signals import Derivatives
from skyarm.reference.task_records import Setting
from skyarm.reference.trajectory import Reference, Trajectory
from skyarm.scenario.governor_limits import MAY_BE_INFINITE, GovernorOptions, Limits
from skyarm.scenario.path_plan import Array, Ceilings, Judge, Plan, plan
from skyarm.scenario.scenario_record import Scenario, ScenarioError

JUMP = 1e-9
"""s before a switch of the reference at which it is looked at for a jump."""

CORNER = 0.02, 0.05
"""m/s of the base and rad/s or m/s of a joint by which a velocity jumps at a corner."""

MISSED = 1.05
"""Share of a limit from which a governor says that it could not keep it."""

STEP = 1e-3
"""m of the base or rad of a joint by which a reference that jumps is told of."""

LONGEST = 1000.0
"""s of a flight that is planned: more takes minutes."""


class GovernorWarning(RuntimeWarning):
    """A governor cannot keep its limits."""


def govern(scenario: Scenario, **options: float) -> Scenario:
    """Return the scenario with a governor of its reference's path parameter.

    Where the reference may be flown as it is commanded nothing is changed.

    Args:
        scenario: whose reference, and whose law's belief.
        options: reserve, tilt, turning, joint_speed, fastest, as ``[reference.governor]`` of a scenario file has them.

    Raises:
        ScenarioError: an option that there is not, or cannot be; a reference with phases that wait (until).
    """
    if not isinstance(scenario, Scenario):
        raise ScenarioError(f"scenario = {shown(scenario)}: must be a Scenario")
    known = field_names(GovernorOptions) or ()
    for name in options:
        if name not in known:
            raise ScenarioError(f"{name}: is no option of a governor; there are {', '.join(known)}")
    try:
        return governed_scenario(scenario, GovernorOptions(**options))
    except ValueError as error:
        raise ScenarioError(str(error)) from None


def options_from(table: Any) -> GovernorOptions:
    """Options of a ``[reference.governor]`` table."""
    fields = Fields(table, "reference.governor")
    names = field_names(GovernorOptions) or ()
    # each is asked for, so that a misspelt one is told of all
    given = {
        name: fields.number(name, infinite=name in MAY_BE_INFINITE)
        for name in names
        if fields.take(name, None) is not None
    }
    fields.done()
    return GovernorOptions(**given)


def governed_scenario(scenario: Scenario, options: GovernorOptions) -> Scenario:
    """The scenario with a planned time of its reference; without any where none is needed."""
    bare = dataclasses.replace(scenario, path_time=None, pause=options.pause)
    if bare.duration > LONGEST:
        allowed = f"must be left out of a flight of more than {LONGEST:g} s"
        raise ValueError(f"reference.governor: {allowed}")
    _require_no_instants(bare)
    found = plan_of(bare, options)
    for line in (*_steps(bare), *_missed(found, bare, options)):
        warnings.warn(f"reference.governor: {line}", GovernorWarning, stacklevel=3)
    return bare if found.path_time is None else dataclasses.replace(bare, path_time=found.path_time)


def _require_no_instants(scenario: Scenario) -> None:
    """Refuse what a flight takes or leaves at instants: they would come before the vehicle."""
    grippers = () if scenario.contact is None else scenario.contact.grippers
    for each in grippers:
        if each.closed.signal.switch_times():
            allowed = f"must be left out where gripper {each.name!r} closes or opens at an instant"
            raise ValueError(f"reference.governor: {allowed}")
    if scenario.payloads and any(change.path.startswith("model.payload.") for change in scenario.changes):
        raise ValueError("reference.governor: must be left out where the law is told of payloads (believed = true)")


def _missed(found: Plan, scenario: Scenario, options: GovernorOptions) -> Iterator[str]:
    if found.beyond > MISSED:
        name = Limits(scenario.controller.par.model, options).names()[found.limit]
        yield f"asks for {found.beyond:.3g} times its limit of {name} at {found.at:.3g} s of the path, however slow"


def _steps(scenario: Scenario) -> Iterator[str]:
    """Steps of the reference: whoever is slower on his way there jumps all the same."""
    for t in scenario.trajectory.switch_times():
        if 0.0 < t < scenario.duration:
            before, after = (scenario.trajectory.at(s) for s in (t - JUMP, t))
            moved = _length(after.position - before.position)
            pairs = zip(before.joints, after.joints, strict=True)
            turned = max((abs(float(a) - float(b)) for a, b in pairs), default=0.0)
            if moved > STEP or turned > STEP:
                how_far = f"{moved:.3g} m" if moved > STEP else f"{turned:.3g} rad or m of a joint"
                yield f"the reference jumps by {how_far} at {t:.3g} s, at any rate; a ramp or waypoints?"


def with_governor(scenario: Scenario, options: GovernorOptions, setting: Setting) -> Scenario:
    """The same for a reference that was read for a setting.

    Raises:
        ValueError: phases that pick or place something: its instants would come before the vehicle.
    """
    if setting.events:
        allowed = f"must be left out of a reference that picks or places something ({setting.events[0].where})"
        raise ValueError(f"reference.governor: {allowed}")
    return governed_scenario(scenario, options)


def plan_of(scenario: Scenario, options: GovernorOptions) -> Plan:
    """The plan of a scenario's reference, from what its law believes."""
    trajectory, limits = scenario.trajectory, Limits(scenario.controller.par.model, options)
    if trajectory.guards:
        raise ValueError("reference.governor: must be left out of a reference whose phases wait (until)")
    ceilings = Ceilings(
        duration=float(scenario.duration), fastest=options.fastest, stops=_corners(trajectory, scenario)
    )

    def motion(s: Derivatives, time: Array) -> Motion:
        return motion_of(by_flight_time(trajectory.at(s[0]), s), time)

    judge = Judge(motion=motion, shares=limits.shares, at_rest=limits.at_rest)
    return plan(judge, ceilings)


def _corners(trajectory: Trajectory, scenario: Scenario) -> list[float]:
    """Times (s) at which the path turns a corner, or sets off at speed from where the vehicle rests."""
    found = []
    if scenario.initial is None and _is_corner(*_speeds(trajectory.at(0.0))):
        found.append(0.0)
    within = (t for t in trajectory.switch_times() if 0.0 < t < scenario.duration)
    return [*found, *(t for t in within if _is_corner(*_jumps(trajectory, t)))]


def _is_corner(base: float, joint: float) -> bool:
    return base > CORNER[0] or joint > CORNER[1]


def _speeds(reference: Reference) -> tuple[float, float]:
    """Speed of the base, m/s, and of the fastest joint."""
    return _length(reference.velocity), max((abs(float(rate)) for rate in reference.joint_rates), default=0.0)


def _jumps(trajectory: Trajectory, t: float) -> tuple[float, float]:
    """By how much the velocity of the base and of a joint jump at a time."""
    before, after = trajectory.at(t - JUMP), trajectory.at(t)
    rates = zip(before.joint_rates, after.joint_rates, strict=True)
    joint = max((abs(float(a) - float(b)) for a, b in rates), default=0.0)
    return _length(after.velocity - before.velocity), joint


def _length(vector: Vec3) -> float:
    return math.hypot(*(float(c) for c in vector))
