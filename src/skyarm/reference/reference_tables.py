"""Trajectories from plain tables, as a scenario file holds them.

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
* ``waypoints``, ``samples``, ``phases``: tasks (:mod:`skyarm.reference.task_tables`, :mod:`skyarm.reference.phases`)
* any motion that was registered, with its own numbers

A fourth entry, ``tip``, is a motion of the tip from which base and joints follow (:mod:`skyarm.reference.tip_tables`).

``yaw`` is a signal (default 0). Without ``joints`` every joint is held at 0. Signals:
:mod:`skyarm.reference.signal_tables`.

Units are SI and radians; ``start`` and ``stop`` make a half-open window. A wrong table raises ValueError with one line:
field, value, what is allowed.
"""

from __future__ import annotations

import inspect
from typing import Any

from skyarm.files import Fields, shown
from skyarm.records.read_table import options_from, takes_table
from skyarm.reference.setting import Setting
from skyarm.reference.signal_tables import signal_from, window_of
from skyarm.reference.trajectory import Trajectory, circle, hover
from skyarm.registry import find

AT_ORIGIN = {"kind": "hover", "position": [0.0, 0.0, 0.0]}
"""The base's motion where a file gives none."""


def trajectory_from(table: dict[str, Any], n_joints: int, where: str, setting: Setting | None = None) -> Trajectory:
    """Trajectory that a table describes; the grammar is this module's.

    Args:
        table: plain dict, as read from TOML.
        n_joints: joints of the vehicle.
        where: file and table, put before the field in messages: "case3.toml: reference".
        setting: what a task needs to know of the flight.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    setting = Setting() if setting is None else setting
    fields = Fields(table, where)
    base = motion_from(fields.take("base", AT_ORIGIN), f"{where}.base", setting)
    yaw = signal_from(fields.take("yaw", 0.0), f"{where}.yaw")
    entries = fields.take("joints", [0.0] * n_joints)
    fields.done()
    if not isinstance(entries, list) or len(entries) != n_joints:
        shown = f"{len(entries)} signals" if isinstance(entries, list) else repr(entries)
        raise ValueError(f"{where}.joints = {shown}: must be a list of {n_joints}, one for each joint of the vehicle")
    joints = tuple(signal_from(entry, f"{where}.joints[{index}]") for index, entry in enumerate(entries))
    return Trajectory(
        x=base.x, y=base.y, z=base.z, yaw=yaw, joints=joints, guards=setting.all_guards, phases=setting.all_phases
    )


def motion_from(entry: Any, where: str, setting: Setting) -> Trajectory:
    """Motion of a point, of the base as a rule, from a table or a list of tables."""
    if isinstance(entry, list):
        total = Trajectory()
        for index, item in enumerate(entry):
            total = total + motion_from(item, f"{where}[{index}]", setting)
        return total
    fields = Fields(entry, where)
    make = find("motion", fields.take("kind"), fields.at("kind"))
    if "setting" in inspect.signature(make).parameters and make.__module__.startswith("skyarm.reference."):
        motion = make(fields, setting)
    else:
        motion = make(fields) if takes_table(make) else make(**options_from(make, fields))
    fields.done()
    if not isinstance(motion, Trajectory):
        raise ValueError(f"{fields.at('kind')} = {entry['kind']!r}: must give a Trajectory, not {shown(motion)}")
    return motion


def hover_table(fields: Fields) -> Trajectory:
    """Stay at ``position``."""
    return hover(fields.vector("position"))


def circle_table(fields: Fields) -> Trajectory:
    """``radius``, ``frequency_hz``, ``center``; ``start`` and ``stop``."""
    radius = fields.number("radius", low=0.0)
    frequency, center = fields.number("frequency_hz"), fields.vector("center")
    start, stop = window_of(fields)
    return circle(radius=radius, frequency_hz=frequency, center=center, start=start, stop=stop)


def signals_table(fields: Fields) -> Trajectory:
    """A signal for each of ``x``, ``y``, ``z``."""
    x, y, z = (signal_from(fields.take(name, 0.0), f"{fields.where}.{name}") for name in "xyz")
    return Trajectory(x=x, y=y, z=z)
