"""Rows of the tables of the pages that list parts of learning environments, trials
of the suites that ship and arrays of a log, and lines of the menu.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from skyarm.envs.action_kinds import ACTIONS
from skyarm.envs.observed_quantities import OBSERVED, USUAL
from skyarm.envs.reward_terms import REWARDS, USUAL_REWARD
from skyarm.log.flight_log import IF_ANY, Log
from skyarm.log.log_columns import COLUMNS
from skyarm.records.field_rules import defaults
from skyarm.records.units import declared_fields, units
from skyarm.studies.compare.contact_tasks import FRICTION, WIND
from skyarm.studies.compare.envelope_axes import AXES
from skyarm.studies.compare.suite import library_rows
from skyarm.studies.compare.survive_trials import TRIALS as SURVIVED

Table = tuple[Sequence[str], list[Sequence[str]]]
"""Heads of a table and its rows."""


def parts_of_environments(of: str) -> Table:
    """Parts of a learning environment: each with its meaning, and its fields with their
    defaults and units.
    """
    kinds = {"actions": ACTIONS, "observation": OBSERVED, "reward": REWARDS}[of]
    rows: list[Sequence[str]] = []
    usual = {type(each): each for each in USUAL_REWARD}
    for name, kind in kinds.items():
        fields = [
            f"`{field}` {_number(defaults(kind)[field])} {unit.unit}".strip()
            for field, (_, unit) in declared_fields(kind).items()
            if field not in ("weight", "joints")
        ]
        used = (
            (f"{usual[kind].weight:g}" if kind in usual else "-",)
            if of == "reward"
            else ("yes" if name in USUAL else "no",)
            if of == "observation"
            else ()
        )
        sentence = " ".join((kind.__doc__ or "").split("\n\n")[0].split())
        rows.append((f"`{name}`", sentence.rstrip("."), ", ".join(fields), *used))
    last = {"actions": (), "observation": ("by default",), "reward": ("by default",)}
    return ("name", "meaning", "fields with defaults", *last[of]), rows


def _number(value: object) -> str:
    return f"{value:g}" if isinstance(value, float | int) else str(value)


def trials_of_suite(name: str) -> Table:
    """Tasks of the contact suite, or conditions of the team suite."""
    if name == "contact":
        return ("task", "what the vehicle does", "friction", "wind"), [
            (
                f"`{each['name']}`",
                each["title"],
                "{:g} to {:g}".format(*each.get("friction", FRICTION)),
                f"up to {each.get('wind', WIND):g} N",
            )
            for each in library_rows("contact_tasks")
        ]
    assert name == "team", f"no trials of {name}"
    return ("condition", "what differs from the scenario"), [
        (f"`{each['name']}`", each.get("own") or each["title"])
        for each in library_rows("team_rows")
    ]


def flown_trials(suite: str) -> Table:
    """Trials of the envelope or of the survive suite, with their values as the tables
    of results show them.
    """
    head = {"envelope": "axis", "survive": "condition"}[suite]
    rows: list[Sequence[str]] = []
    for name, trial in (AXES if suite == "envelope" else SURVIVED).items():
        scale = getattr(trial, "shown", 1.0)
        values = ", ".join(f"{value * scale:g}" for value in trial.values)
        noisy = "yes" if trial.noisy else "no"
        unit = trial.unit.removesuffix(" late")
        rows.append((f"`{name}`", trial.title, values, unit, noisy))
    return (head, "flown", "values", "unit", "noisy"), rows


SHAPES = {
    "joints": "N, joints",
    "rotors": "N, rotors",
    "tilting": "N, tilting rotors",
    "loops": "N, 2",
}
SCALARS = (
    "time",
    "yaw_held",
    "yaw_reference",
    "path_time",
    "phase",
    "load_mass_found",
    "push_deviation",
)
NAMES = {
    "joints": "_JOINT",
    "rotors": "_ROTOR",
    "tilting": "_ROTOR",
    "loops": "_rotors, _joints",
}


def shape_of(array: str) -> str:
    """Shape of an array of a log in words, N its instants."""
    group = COLUMNS.get(array, ("", ""))[1]
    return (
        SHAPES[group]
        if group
        else "N"
        if array in SCALARS
        else "N, 4"
        if array == "quaternion"
        else "N, 3"
    )


def columns_of(array: str) -> str:
    """Names of the columns of an array in CSV and MCAP files."""
    begin, group = COLUMNS.get(array, (array, ""))
    if group:
        return ", ".join(f"`{begin}{end}`" for end in NAMES[group].split(", "))
    axes = {"N": ("",), "N, 3": ("_x", "_y", "_z"), "N, 4": ("_w", "_x", "_y", "_z")}[
        shape_of(array)
    ]
    return ", ".join(f"`{begin}{axis}`" for axis in axes)


def arrays_of_log(part: str) -> Table:
    """Arrays of a log: those of every flight, or those that only some flights have."""
    listed = [name for name in units(Log) if (name in IF_ANY) == (part == "optional")]
    assert part in ("arrays", "optional")
    rows: list[Sequence[str]] = [
        (
            f"`{n}`",
            shape_of(n),
            units(Log)[n].unit,
            units(Log)[n].meaning,
            columns_of(n),
        )
        for n in listed
    ]
    return ("array", "shape", "unit", "meaning", "columns in CSV and MCAP"), rows


def menu_lines(entries: list[Any], indent: str, docs: Path) -> list[str]:
    """Lines of a nested list of a menu's entries that are pages of this folder."""
    lines: list[str] = []
    for entry in entries:
        name, inside = (
            next(iter(entry.items())) if isinstance(entry, dict) else ("", entry)
        )
        if not isinstance(inside, str):
            below = menu_lines(inside, f"{indent}  ", docs)
            lines += [f"{indent}* {name}", *below] if below else []
        elif (docs / inside).is_file():
            lines.append(f"{indent}* [{name or 'Overview'}]({inside})")
    return lines
