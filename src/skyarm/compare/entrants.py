"""Who flies: laws with their gains, in the order of the tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from skyarm.compare.suite import DELAY
from skyarm.control.controller import Controller
from skyarm.control.model import Model
from skyarm.control.presets import ACCELERATION, HUMMINGBIRD, PRESETS, preset
from skyarm.control.registry import LAWS, make_controller, suited
from skyarm.control.tuned import tuned

NOTHING: Mapping[str, Any] = MappingProxyType({})

PAPER_GAINS: Mapping[str, Any] = {"gains": HUMMINGBIRD, "joint_gains": ACCELERATION}
"""Every step of the ladder flies with the paper's gains: what changes is the law."""

ABLATIONS: Mapping[str, Mapping[str, Any]] = {
    "without observer": {"observer": (1e-3, 1e-3, 1e-3, 1e6), "measured_rates": 1.0, "trim_rate": 0.0},
    "without continuation": {"continuation": 0.0},
    "without lag inversion": {"lag_inversion": 0.0},
    "without rotor trim": {"trim_rate": 0.0},
}
"""The exact law without one of its parts; without an observer it takes the velocities of the sensors."""


@dataclass(frozen=True, kw_only=True)
class Entrant:
    """A law as it enters the bench.

    Attributes:
        name: short name. group: "paper", "step" (the paper's law made better), "rival", "exact" or "part" (the exact
            law without one of its parts).
        law: a preset or a law. options: of the law, whatever the condition. perfect, noisy: options for either kind.
        tuned: with the gains of :mod:`skyarm.control.tuned`. told: of a delay that is known.
    """

    name: str
    group: str
    law: str
    options: Mapping[str, Any] = field(default_factory=lambda: NOTHING)
    perfect: Mapping[str, Any] = field(default_factory=lambda: NOTHING)
    noisy: Mapping[str, Any] = field(default_factory=lambda: NOTHING)
    tuned: bool = False
    told: bool = True

    def controller(self, model: Model, *, noisy: bool) -> Controller:
        """The law with its belief; a law that can use a known delay is told of it."""
        if self.law in PRESETS:
            return preset(self.law, model)
        options = {**self.options, **(self.noisy if noisy else self.perfect)}
        if noisy and self.told:
            options |= suited(self.law, {"delay": DELAY, "delay_periods": 1})
        return tuned(self.law, model, **options) if self.tuned else make_controller(self.law, model, **options)

    @property
    def title(self) -> str:
        """The law in one line."""
        return LAWS[PRESETS[self.law].law if self.law in PRESETS else self.law].title


def _all() -> tuple[Entrant, ...]:
    """Everyone, in the order of the tables."""
    steps = ("ct_coupled_thrust", "ct_consistent", "ct_observer", "ct_feedforward", "ct_extrapolation")
    rivals = (
        *("bulut_computed_torque_style", "guo_center_of_inertia_style", "li_feedforward_style"),
        *("kim_sliding_mode_style", "l1_adaptive", "l1_adaptive_lateral", "indi"),
    )
    stiff = {"preset": "stiff"}
    return (
        Entrant(name="paper_pd", group="paper", law="paper_pd"),
        Entrant(name="paper_ct", group="paper", law="paper_ct"),
        Entrant(name="ct_level_gravity", group="step", law="ct_level_gravity", options=PAPER_GAINS),
        *(Entrant(name=name, group="step", law=name, options=PAPER_GAINS) for name in (*steps, "ct_lag_inversion")),
        Entrant(name="paper_pd (tuned)", group="rival", law="decoupled_pd", tuned=True),
        Entrant(name="paper_ct (tuned)", group="rival", law="hybrid_computed_torque", tuned=True),
        Entrant(name="ct_lag_inversion (tuned)", group="rival", law="ct_lag_inversion", tuned=True),
        *(Entrant(name=name, group="rival", law=name, tuned=True) for name in rivals),
        Entrant(name="learned_compensator_style", group="rival", law="learned_compensator_style", tuned=True),
        Entrant(name="nmpc", group="rival", law="nmpc"),
        Entrant(name="nmpc (tuned)", group="rival", law="nmpc", tuned=True),
        Entrant(name="exact_joint", group="exact", law="exact", options={"mode": "joint"}, perfect=stiff),
        Entrant(name="exact_ee", group="exact", law="exact", options={"mode": "ee"}, perfect=stiff),
        *(
            Entrant(
                name=f"exact_ee {name}", group="part", law="exact", options={"mode": "ee", **without}, perfect=stiff
            )
            for name, without in ABLATIONS.items()
        ),
        Entrant(
            name="exact_ee without prediction",
            group="part",
            law="exact",
            options={"mode": "ee"},
            perfect=stiff,
            told=False,
        ),
        Entrant(
            name="exact_ee without adaptation",
            group="part",
            law="exact",
            options={"mode": "ee", "adaptation": 0.0, "friction_adaptation": 0.0},
            perfect=stiff,
        ),
    )


ENTRANTS: Mapping[str, Entrant] = {each.name: each for each in _all()}
