"""Who flies: laws with their gains, in the order of the tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from skyarm.compare.suite import DELAY
from skyarm.control.catalogue import (
    ACCELERATION,
    HUMMINGBIRD,
    LAWS,
    PRESETS,
    full_name,
    make_controller,
    make_tuned,
    preset,
    suitable_options,
)
from skyarm.control.controller import Controller
from skyarm.control.model import Model
from skyarm.registry.plugins import law_of_file_name
from skyarm.registry.registrations import SHIPPED, registrations

PAPER_GAINS: Mapping[str, Any] = {"gains": HUMMINGBIRD, "joint_gains": ACCELERATION}
"""Every step of the ladder flies with the paper's gains: what changes is the law."""

ABLATIONS: Mapping[str, Mapping[str, Any]] = {
    "without observer": {"observer": (1e-3, 1e-3, 1e-3, 1e6), "measured_rates": 1.0, "trim_rate": 0.0},
    "without continuation": {"continuation": 0.0},
    "without lag inversion": {"lag_inversion": 0.0},
    "without rotor trim": {"trim_rate": 0.0},
}
"""The centroidal law without one of its parts; without an observer it takes the velocities of the sensors."""


@dataclass(frozen=True, kw_only=True)
class Entrant:
    """A law as it enters the comparison.

    Attributes:
        name: short name. group: "paper", "step" (the paper's law made better), "published", "centroidal" or "part"
            (the centroidal law without one of its blocks).
        law: a preset or a law. options: of the law, whatever the condition. perfect, noisy: options for either kind.
        tuned: with the gains of :mod:`skyarm.control.catalogue`. told: of a delay that is known.
    """

    name: str
    group: str
    law: str
    options: Mapping[str, Any] = field(default_factory=dict)
    perfect: Mapping[str, Any] = field(default_factory=dict)
    noisy: Mapping[str, Any] = field(default_factory=dict)
    tuned: bool = False
    told: bool = True

    def controller(self, model: Model, *, noisy: bool) -> Controller:
        """The law with its belief; a law that can use a known delay is told of it."""
        if self.law in PRESETS:
            return preset(self.law, model)
        options = {**self.options, **(self.noisy if noisy else self.perfect)}
        if noisy and self.told:
            options |= suitable_options(self.law, {"delay": DELAY, "delay_periods": 1})
        return make_tuned(self.law, model, **options) if self.tuned else make_controller(self.law, model, **options)

    @property
    def title(self) -> str:
        """The law in one line."""
        return LAWS[PRESETS[self.law].law if self.law in PRESETS else self.law].title


def _all() -> tuple[Entrant, ...]:
    """Everyone, in the order of the tables."""
    steps = ("ct_coupled_thrust", "ct_consistent", "ct_observer", "ct_feedforward", "ct_extrapolation")
    published = (
        *("bulut2019", "guo2023", "li2024"),
        *("kim2013", "l1_adaptive", "l1_adaptive_lateral", "indi"),
    )
    own = "centroidal"
    gains: Mapping[str, Any] = {"perfect": {"preset": "stiff"}, "noisy": {"preset": "adaptive"}}
    return (
        Entrant(name="paper_pd", group="paper", law="paper_pd"),
        Entrant(name="paper_ct", group="paper", law="paper_ct"),
        Entrant(name="ct_level_gravity", group="step", law="ct_level_gravity", options=PAPER_GAINS),
        *(Entrant(name=name, group="step", law=name, options=PAPER_GAINS) for name in (*steps, "ct_lag_inversion")),
        Entrant(name="paper_pd (tuned)", group="published", law="decoupled_pd", tuned=True),
        Entrant(name="paper_ct (tuned)", group="published", law="hybrid_computed_torque", tuned=True),
        Entrant(name="ct_lag_inversion (tuned)", group="published", law="ct_lag_inversion", tuned=True),
        *(Entrant(name=name, group="published", law=name, tuned=True) for name in published),
        Entrant(name="learned_compensator", group="published", law="learned_compensator", tuned=True),
        Entrant(name="nmpc", group="published", law="nmpc"),
        Entrant(name="nmpc (tuned)", group="published", law="nmpc", tuned=True),
        Entrant(
            name="centroidal_joint",
            group="centroidal",
            law="centroidal",
            options={"mode": "joint"},
            **gains,
        ),
        Entrant(name="centroidal_tip", group=own, law="centroidal", options={"mode": "tip"}, **gains),
        *(
            Entrant(
                name=f"centroidal_tip {name}",
                group="part",
                law="centroidal",
                options={"mode": "tip", **without},
                **gains,
            )
            for name, without in ABLATIONS.items()
        ),
        Entrant(
            name="centroidal_tip without prediction",
            group="part",
            law="centroidal",
            options={"mode": "tip"},
            **gains,
            told=False,
        ),
        Entrant(
            name="centroidal_tip without adaptation",
            group="part",
            law="centroidal",
            options={"mode": "tip", "adaptation": 0.0, "friction_adaptation": 0.0},
            **gains,
        ),
    )


def entrant_name(name: str) -> str:
    """The entrant's own name where it is given by an alias or an old name of its controller ("exact_ee (tuned)")."""
    law, space, rest = name.partition(" ")
    return f"{full_name(law)}{space}{rest}"


def own_entrant(law: str) -> Entrant | None:
    """A registered law of someone's own as an entrant, with its own gains; None for any other name."""
    row = registrations("law").get(law)
    if row is None or row.source == SHIPPED:
        return None
    return Entrant(name=law_of_file_name(law), group="own", law=law)


ENTRANTS: Mapping[str, Entrant] = {each.name: each for each in _all()}
