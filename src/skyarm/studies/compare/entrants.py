"""Controllers that take part in the shipped comparison, with their gains."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import field
from typing import Any

from skyarm.control.catalogue import (
    ACCELERATION,
    HUMMINGBIRD,
    LAWS,
    PRESETS,
    is_named,
    make_controller,
    make_tuned,
    must_be_named,
    preset,
    require_different,
    suitable_options,
)
from skyarm.control.controller import Controller
from skyarm.control.model import Model, Terms
from skyarm.records.files import must_be_one_of, shown
from skyarm.records.immutable import immutable
from skyarm.records.registry import registrations
from skyarm.records.registry.plugins import law_of_file_name
from skyarm.records.registry.registrations import SHIPPED
from skyarm.studies.compare.suite import library_rows
from skyarm.studies.trial.trial import DELAY

PAPER_GAINS: Mapping[str, Any] = {"gains": HUMMINGBIRD, "joint_gains": ACCELERATION}
"""Gains of every step of the ladder: the paper's; only the law differs."""


TUNED: Mapping[str, str] = {
    "paper_pd": "decoupled_pd_tuned",
    "paper_ct": "hybrid_computed_torque_tuned",
}
"""Law with the paper's gains -> the same law with tuned gains, for vehicles that the
paper's gains do not fit."""


@immutable
class Entrant:
    """Controller that takes part in a comparison: control law, options and gains.

    Attributes:
        name: short name. group: "paper", "step" (the paper's law made better),
            "published", "centroidal" or "part" (the centroidal law without one of its
            blocks), and "own" of any other.
        law: a preset or a law. options: options of the law, whatever the condition.
        perfect, noisy: options for either kind.
        tuned: whether it has the gains of :mod:`skyarm.control.catalogue`.
        knows_delay: whether it receives a known delay.
    """

    name: str
    group: str = "own"
    law: str
    options: Mapping[str, Any] = field(default_factory=dict)
    perfect: Mapping[str, Any] = field(default_factory=dict)
    noisy: Mapping[str, Any] = field(default_factory=dict)
    tuned: bool = False
    knows_delay: bool = True

    def controller(self, model: Model, *, noisy: bool) -> Controller:
        """Make the controller for a nominal model, with the known measurement delay if
        the law has such an option.
        """
        if self.law in PRESETS:
            return preset(self.law, model)
        options = {**self.options, **(self.noisy if noisy else self.perfect)}
        if noisy and self.knows_delay:
            options |= suitable_options(self.law, {"delay": DELAY, "delay_periods": 1})
        return (
            make_tuned(self.law, model, **options)
            if self.tuned
            else make_controller(self.law, model, **options)
        )

    @property
    def title(self) -> str:
        """One-line description of the controller."""
        return LAWS[PRESETS[self.law].law if self.law in PRESETS else self.law].title


def own_entrant(law: str) -> Entrant | None:
    """Comparison entry for a registered user-defined controller; None for any other
    name.
    """
    row = registrations("law").get(law)
    if row is None or row.source == SHIPPED:
        return None
    return Entrant(name=law_of_file_name(law), law=law)


def chosen_entrants(names: Sequence[str], field: str) -> dict[str, Entrant]:
    """Look up the controllers of a comparison by the names of their control laws.

    Raises:
        ValueError: one line with the field: a name that is none, or two names of one
            law.
    """
    require_different(names, field)
    # shipped ones in the order of the tables, whatever that of the names
    chosen = {name: each for name, each in ENTRANTS.items() if name in names}
    for name in names:
        entrant = ENTRANTS.get(name) or own_entrant(name)
        if entrant is None:
            raise ValueError(
                f"{field} = {shown(name)}: {must_be_one_of(ENTRANTS, name)}"
            )
        if chosen.setdefault(entrant.name, entrant) != entrant:
            raise ValueError(
                f"{field} = {shown(','.join(names))}: must not name two files and"
                " makers of the same names"
            )
    return chosen


def chosen_laws(
    names: Sequence[str], field: str, own: Collection[str]
) -> tuple[str, ...]:
    """Check control law names against the registered laws and the additional names
    ``own`` of a benchmark.

    Raises:
        ValueError: one line with the field: a name that is none, or two names of one
            law.
    """
    require_different(names, field)
    for name in names:
        if name not in own and not is_named(name):
            theirs = f"one of {', '.join(own)}, or " if own else ""
            raise ValueError(f"{field} = {shown(name)}: {must_be_named(name, theirs)}")
    return tuple(names)


def _entrant(row: dict[str, Any]) -> Entrant:
    """Create the comparison entry of a controller from its table in the shipped TOML
    file of controllers.
    """
    options = {
        key: tuple(each) if isinstance(each, list) else each
        for key, each in row.pop("options", {}).items()
    }
    # a table names the terms that are off; all others are on
    if "without" in options:
        options["terms"] = Terms(**dict.fromkeys(options.pop("without"), False))
    gains = PAPER_GAINS if row.pop("paper_gains", False) else {}
    return Entrant(options={**gains, **options}, **row)


ENTRANTS: Mapping[str, Entrant] = {
    row["name"]: _entrant(row) for row in library_rows("entrants")
}
"""Entrants by name, in the order of the tables."""
