"""Reference trajectories from the table ``[reference]`` of a scenario file.

A table has up to three entries, all optional::

    [reference.base]                   # a motion of the base
    kind = "circle"
    radius = 0.3                       # m
    frequency_hz = 0.08
    center = [0, 0, 1]                 # m
    start = 6                          # s
    stop = 21

    [[reference.joints]]               # one signal a joint, in the vehicle's order
    kind = "sine"
    amplitude = 0.2
    frequency_hz = 0.08
    start = 6
    stop = 21

Motions of the base (kind; a list of motions is their sum):

* ``hover``: position
* ``circle``: radius, frequency_hz, center; start, stop (outside: the centre)
* ``signals``: x, y, z, each a signal (default 0)
* ``waypoints``, ``phases``: tasks (:mod:`skyarm.reference.waypoints`,
  :mod:`skyarm.reference.phases`)
* any motion that was registered, with its own numbers

A fourth entry, ``tip``, is a motion of the tip from which base and joints follow.

``yaw`` is a signal (default 0). Without ``joints`` every joint is held at 0. Signals:
:mod:`skyarm.reference.signal_tables`.

Units are SI and radians; ``start`` and ``stop`` make a half-open window. A wrong table
raises ValueError with one line: field, value, what is allowed.

``[reference.push]``: the force with which the tip presses on a surface, and what is
believed of that surface.

::

    [reference.push]
    # N, a signal; 0 asks for no contact
    force = { kind = "sequence", start = 2, segments = [[1.0, 5.0]] }
    normal = [-1, 0, 0]          # world axes, out of the surface; of any length
    speed = 0.1                  # m/s, with which the tip comes; left out: 0.1
    # above 0.5: the tip is held by what it grips; left out: never
    grip = { kind = "constant", value = 1, start = 4 }
    # m: while it grips, the normal points from the axis through here to the tip
    pivot = [0.5, 0.8, 1.2]
    axis = [0, 0, 1]             # of any length; left out: upright

A wrong table raises ValueError with one line: field, value, what is allowed.

``[reference.tip]``: a motion of the tip, from which base and joints follow.

::

    [reference.tip]
    # a motion, or a list of them
    path = { kind = "circle", radius = 0.2, frequency_hz = 0.1, center = [0, 0, 0.7] }
    # joints that the arm prefers, rad or m; the middle of their limits if left out
    posture = [0.4, -0.8]
    # of the tip's way in the world that the base takes; 1: the arm stays in its posture
    base_share = 0.7
    arm_range = 0.1              # m, that the arm moves its tip at most for the rest
    # signals: roll, pitch, yaw (ZYX) of the tip in the world
    orientation = [0.0, 0.0, 0.0]
    joint_speed = 2.0            # rad/s or m/s, the largest that is planned
    rate = 10.0                  # Hz of the plan's samples

The joints follow from ``posture`` and inverse kinematics: ``[[reference.joints]]``
stands nowhere beside it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from skyarm.records.arrays import Array, doubles
from skyarm.records.files import Fields, shown
from skyarm.records.read_table import options_from, record_from, takes_table
from skyarm.records.registry import find
from skyarm.records.units import FARTHEST, parameters_of
from skyarm.reference.planned_motion import PlannedBody, plan_tables
from skyarm.reference.signal_tables import window_of
from skyarm.reference.signals import Constant, Signal, signal_from
from skyarm.reference.task_records import Setting
from skyarm.reference.tip_motion import FASTEST, STRONGEST, TipPush
from skyarm.reference.trajectory import Trajectory, circle, hover
from skyarm.vehicle import BASE, Vehicle

AT_ORIGIN = {"kind": "hover", "position": [0.0, 0.0, 0.0]}
"""Motion of the base if a file states none."""


BESIDE = ("push", "load", "planned", "tip", "tracking_start", "governor", "object")
"""Keys of [reference] that are read elsewhere; for messages."""


def trajectory_from(
    table: object, n_joints: int, where: str, setting: Setting | None = None
) -> Trajectory:
    """Trajectory of base and joints from a reference table of a scenario file.

    Args:
        table: table as read from TOML.
        n_joints: joints of the vehicle.
        where: file and table, put before the field in messages: "case3.toml:
            reference".
        setting: flight data that a task needs.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    setting = Setting() if setting is None else setting
    fields = Fields(table, where)
    base = motion_from(fields.take("base", AT_ORIGIN), f"{where}.base", setting)
    yaw = signal_from(fields.take("yaw", 0.0), f"{where}.yaw")
    entries = fields.take("joints", [0.0] * n_joints)
    fields.done(BESIDE if where == "reference" else ())
    if not isinstance(entries, list) or len(entries) != n_joints:
        shown = (
            f"{len(entries)} signals" if isinstance(entries, list) else repr(entries)
        )
        raise ValueError(
            f"{where}.joints = {shown}: must be a list of {n_joints}, one for each"
            " joint of the vehicle"
        )
    joints = tuple(
        signal_from(entry, f"{where}.joints[{index}]")
        for index, entry in enumerate(entries)
    )
    return Trajectory(
        x=base.x,
        y=base.y,
        z=base.z,
        yaw=yaw,
        joints=joints,
        guards=setting.all_guards,
        phases=setting.all_phases,
    )


def motion_from(entry: object, where: str, setting: Setting) -> Trajectory:
    """Position trajectory of a point from a motion table or a list of motion tables."""
    if isinstance(entry, list):
        total = Trajectory()
        for index, item in enumerate(entry):
            total = total + motion_from(item, f"{where}[{index}]", setting)
        return total
    fields = Fields(entry, where)
    make = find("motion", fields.take("kind"), fields.at("kind"))
    # a registered motion of a user may have a number of that name
    if "setting" in parameters_of(make) and make.__module__.startswith(
        "skyarm.reference."
    ):
        motion = make(fields, setting)
    else:
        motion = (
            make(fields) if takes_table(make) else make(**options_from(make, fields))
        )
    fields.done()
    if not isinstance(motion, Trajectory):
        raise ValueError(
            f"{fields.at('kind')} = {fields.table['kind']!r}: must give a Trajectory,"
            f" not {shown(motion)}"
        )
    return motion


def hover_table(fields: Fields) -> Trajectory:
    """Trajectory at a constant position, from a motion table."""
    return hover(fields.vector("position"))


def circle_table(fields: Fields) -> Trajectory:
    """Circular trajectory from a motion table with radius, frequency, centre and time
    window.
    """
    radius = fields.number("radius", low=0.0)
    frequency, center = fields.number("frequency_hz"), fields.vector("center")
    start, stop = window_of(fields)
    return circle(
        radius=radius, frequency_hz=frequency, center=center, start=start, stop=stop
    )


def signals_table(fields: Fields) -> Trajectory:
    """Position trajectory from a motion table with one time signal each for x, y and
    z.
    """
    x, y, z = (
        signal_from(fields.take(name, 0.0), f"{fields.where}.{name}") for name in "xyz"
    )
    return Trajectory(x=x, y=y, z=z)


SHORTEST = 1e-6
"""Length of a normal below which its direction is undefined."""

LOOKS = 401
"""Number of instants of a flight at which the force is evaluated, in addition to its
switches; chosen."""

ROUNDING = 1e-6
"""Force (N) below 0 that is rounding without a grip; a smooth ramp back to 0 does not
end at an exact 0."""


def push_from(table: object, where: str, duration: float = 0.0) -> TipPush:
    """Desired tip contact from the table ``[reference.push]`` of a scenario file.

    Args:
        table: table as above.
        where: its name.
        duration: duration of the flight, s, in the course of which the force is looked
            at.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    fields = Fields(table, where)
    for name, needed in (("pivot", "grip"), ("axis", "pivot")):
        if name in fields.table and needed not in fields.table:
            raise ValueError(
                f"{fields.at(name)} = {shown(fields.table[name])}: must be left out"
                f" without {needed}"
            )
    vectors = {
        name: fields.vector(name)
        for name in ("normal", "pivot", "axis")
        if name in fields.table
    }
    push = record_from(TipPush, fields)
    for name, way in (("normal", "out of the surface"), ("axis", "along the axis")):
        if name in vectors and math.hypot(*vectors[name]) < SHORTEST:
            raise ValueError(
                f"{fields.at(name)} = {shown(list(vectors[name]))}: must point {way}"
            )
    if not 0.0 < float(push.speed) <= FASTEST:
        raise ValueError(
            f"{fields.at('speed')} = {push.speed:g}: must be above 0 and at most"
            f" {FASTEST:g}"
        )
    _require_force(
        push.force, fields.at("force"), duration, pulls=push.grip is not None
    )
    return push


def _require_force(force: Signal, at: str, duration: float, *, pulls: bool) -> None:
    """Refuse an excessive desired contact force, and a pulling force without a grip."""
    looks, newtons = _over_time(force, duration)
    worst = int(np.argmax(np.abs(newtons)))
    if abs(newtons[worst]) > STRONGEST:
        raise ValueError(
            f"{at} = {newtons[worst]:g} N at {looks[worst]:.4g} s: must be at most"
            f" {STRONGEST:g} N"
        )
    least = int(np.argmin(newtons))
    if not pulls and newtons[least] < -ROUNDING:
        allowed = "must be at least 0 without grip; what only presses cannot pull"
        raise ValueError(
            f"{at} = {newtons[least]:g} N at {looks[least]:.4g} s: {allowed}"
        )


def _require_reach(trajectory: Trajectory, where: str, duration: float) -> None:
    """Refuse a reference beyond ``FARTHEST`` (m or rad) at any time of the flight."""
    signals = [
        (f"{where}.base.{axis}", getattr(trajectory, axis), " m") for axis in "xyz"
    ]
    signals += [(f"{where}.yaw", trajectory.yaw, " rad")]
    signals += [
        (f"{where}.joints[{i}]", signal, "")
        for i, signal in enumerate(trajectory.joints)
    ]
    for at, signal, unit in signals:
        looks, values = _over_time(signal, duration)
        # NaN is too far, too
        far = ~(np.abs(values) <= FARTHEST)
        if far.any():
            k = int(np.argmax(far))
            raise ValueError(
                f"{at} = {values[k]:g}{unit} at {looks[k]:.4g} s: must be at most"
                f" {FARTHEST:g} in size"
            )


def _over_time(signal: Signal, duration: float) -> tuple[Array, Array]:
    """Instants (s) of a flight, switch times among them, and the values of a signal
    there.
    """
    if type(signal) is Constant:
        return np.zeros(1), doubles([signal.value])
    switches = sorted({0.0, *map(float, signal.switch_times()), duration})
    # a signal may be large between two switches that no even instant meets
    between = [0.5 * (a + b) for a, b in itertools.pairwise(switches)]
    looks = np.concatenate([switches, between, np.linspace(0.0, duration, LOOKS)])
    # what overflows is refused by its size, in one line
    with np.errstate(all="ignore"):
        return looks, np.broadcast_to(
            doubles(signal.derivatives(looks)[0]), looks.shape
        )


def reference_from(
    table: object, n_joints: int, where: str, setting: Setting
) -> Trajectory:
    """Trajectory from the whole reference table of a scenario file, with optional tip
    motion and contact.

    Args:
        table: table of the whole reference: what
            :func:`skyarm.reference.trajectory_from` takes, ``tip``, ``push`` and
            ``load``.
        n_joints: joints of the vehicle.
        where: name of the reference's table.
        setting: flight data: vehicle, duration, gravity.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    whole = Fields(table, where)
    given: Mapping[str, Any] = whole.table
    if given.get("kind") == "plan":
        given = plan_tables(whole, setting.vehicle.name if setting.vehicle else None)
    apart = ("push", "load", "planned")
    own = {name: value for name, value in given.items() if name in apart}
    rest = {name: value for name, value in given.items() if name not in apart}
    carried = setting.carried
    push = (
        push_from(own["push"], f"{where}.push", setting.duration)
        if "push" in own
        else None
    )
    load = signal_from(own["load"], f"{where}.load") if "load" in own else None
    planned = (
        record_from(PlannedBody, Fields(own["planned"], f"{where}.planned"))
        if "planned" in own
        else None
    )
    if "tip" in rest:
        from skyarm.reference.tip_plan import tip_trajectory

        base = trajectory_from(
            {k: v for k, v in rest.items() if k not in ("tip", "joints")},
            n_joints,
            where,
            setting,
        )
        fields = Fields(rest["tip"], f"{where}.tip")
        vehicle = _vehicle(setting, fields.where)
        if "joints" in rest:
            raise ValueError(
                f"{where}.joints = {shown(rest['joints'])}: must be left out beside"
                " tip; see tip.posture"
            )
        if carried is None:
            path = motion_from(fields.take("path"), fields.at("path"), setting)
        else:
            path = carried
            base = replace(base, yaw=base.yaw + carried.yaw)
        trajectory = tip_trajectory(fields, base, path, vehicle, setting)
        if "base" in rest:
            raise ValueError(
                f"{where}.base = {shown(rest['base'])}: must be left out, the base"
                " follows from tip.path"
            )
    else:
        trajectory = trajectory_from(rest, n_joints, where, setting)
        if carried is not None and "base" not in rest:
            yaw = trajectory.yaw + carried.yaw
            trajectory = replace(
                trajectory, x=carried.x, y=carried.y, z=carried.z, yaw=yaw
            )
        if setting.joint_moves:
            from skyarm.reference.phases import with_joint_moves

            trajectory = with_joint_moves(
                trajectory, setting.joint_moves, setting.vehicle
            )
    if setting.pushes and push is not None:
        raise ValueError(f"{where}.push: must be left out beside phases that press")
    push = setting.pushes[0] if setting.pushes else push
    _require_reach(trajectory, where, setting.duration)
    return replace(trajectory, push=push, load=load, planned=planned)


def _vehicle(setting: Setting, where: str) -> Vehicle:
    vehicle = setting.vehicle
    if vehicle is None or not vehicle.end_effector:
        name = (
            "none is known"
            if vehicle is None
            else f"{vehicle.name!r} has none (end_effector)"
        )
        raise ValueError(f"{where}: needs a vehicle with a tip; {name}")
    link = vehicle.frame().link
    if link == BASE or link >= vehicle.n:
        body = "the base" if link == BASE else "a link that follows others"
        raise ValueError(
            f"{where}: needs a tip that joints move; that of {vehicle.name!r} is fixed"
            f" to {body}"
        )
    return vehicle
