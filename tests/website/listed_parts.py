"""Rows of the tables of the reference pages that list parts of learning environments,
and trials of the suites that ship.
"""

from __future__ import annotations

from collections.abc import Sequence

from skyarm.envs.action_kinds import ACTIONS
from skyarm.envs.observed_quantities import OBSERVED, USUAL
from skyarm.envs.reward_terms import REWARDS, USUAL_REWARD
from skyarm.records.field_rules import defaults
from skyarm.records.units import declared_fields
from skyarm.studies.compare.contact_tasks import FRICTION, WIND
from skyarm.studies.compare.suite import library_rows
from skyarm.studies.compare.survive_trials import TRIALS

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
    """Trials of a suite that ships, from the tables of its library."""
    if name == "survive":
        return ("condition", "flight", "values", "unit"), [
            (
                f"`{each.name}`",
                each.title,
                ", ".join(f"{value:g}" for value in each.values),
                each.unit,
            )
            for each in TRIALS.values()
        ]
    rows = [*library_rows(SUITES[name])]
    if name == "contact":
        heads: Sequence[str] = ("task", "what the vehicle does", "friction", "wind")
        cells = [
            (
                f"`{each['name']}`",
                each["title"],
                "{:g} to {:g}".format(*each.get("friction", FRICTION)),
                f"up to {each.get('wind', WIND):g} N",
            )
            for each in rows
        ]
    elif name == "team":
        heads = ("condition", "what differs from the scenario")
        cells = [
            (f"`{each['name']}`", each.get("own") or each["title"]) for each in rows
        ]
    else:
        heads = ("trial", "flight", "values", "unit", "noisy")
        cells = [
            (
                f"`{each['name']}`",
                each["title"],
                ", ".join(
                    f"{value * each.get('shown', 1.0):g}"
                    for value in each.get("values", ())
                ),
                each.get("unit", ""),
                "yes" if each.get("noisy") else "no",
            )
            for each in rows
        ]
    return heads, cells


SUITES = {
    "envelope": "envelope_axes",
    "contact": "contact_tasks",
    "team": "team_rows",
}
"""Suite -> its library's table."""
