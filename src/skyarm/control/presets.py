"""Controllers with published gains, by name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from skyarm.algebra import Vec3
from skyarm.control.model import GeometricGains, JointGains, Model
from skyarm.control.registry import Controller, ControllerError, make_controller, suited
from skyarm.files import shown

HUMMINGBIRD = GeometricGains(
    position=Vec3(4.0, 4.0, 4.0),
    velocity=Vec3(2.2, 2.2, 2.2),
    attitude=Vec3(0.7, 0.7, 0.035),
    rate=Vec3(0.1, 0.1, 0.025),
)
"""RotorS, lee_controller_hummingbird.yaml; the paper's Tables A1 and A2 repeat it."""

ACCELERATION = JointGains(stiffness=(350.0, 150.0), damping=(12.0, 10.0))
"""Barakou et al. 2026, Table A1: 1/s^2 and 1/s."""

TORQUE = JointGains(stiffness=(1.0, 0.5), damping=(0.04, 0.02))
"""Barakou et al. 2026, Table A2: N m/rad and N m s/rad."""


@dataclass(frozen=True, slots=True)
class Preset:
    """A law with its published gains or other options.

    Attributes:
        title: one line for people. law: a key of ``LAWS``. options: of the law.
    """

    title: str
    law: str
    options: Mapping[str, Any]


PRESETS: Mapping[str, Preset] = {
    "paper_ct": Preset(
        "the paper's computed torque, gains of its Table A1",
        "hybrid_computed_torque",
        {"gains": HUMMINGBIRD, "joint_gains": ACCELERATION},
    ),
    "paper_ct_euler": Preset(
        "the same gains in the paper's Euler-angle equations",
        "hybrid_computed_torque_euler",
        {"gains": HUMMINGBIRD, "joint_gains": ACCELERATION},
    ),
    "paper_pd": Preset(
        "the paper's baseline, gains of its Table A2",
        "decoupled_pd",
        {"gains": HUMMINGBIRD, "joint_gains": TORQUE},
    ),
    "rotors_hummingbird": Preset(
        "RotorS's controller with its Hummingbird's gains, joints free", "rotors_position", {"gains": HUMMINGBIRD}
    ),
    "exact_joint": Preset("the exact law, base and joints exact, robust", "exact", {"mode": "joint"}),
    "exact_joint_stiff": Preset(
        "the exact law, base and joints exact, for perfect state", "exact", {"mode": "joint", "preset": "stiff"}
    ),
    "exact_ee": Preset("the exact law, the tip exact, robust", "exact", {"mode": "ee"}),
    "exact_ee_stiff": Preset(
        "the exact law, the tip exact, for perfect state", "exact", {"mode": "ee", "preset": "stiff"}
    ),
}
"""The paper's controllers with its gains, and the exact law with its own."""


def preset(name: str, model: Model, known: Mapping[str, Any] | None = None) -> Controller:
    """A controller by the name of its gains.

    Args:
        name: a key of ``PRESETS``.
        model: what it believes.
        known: what a law may know of its loop, as far as it has such options: ``delay``, ``control_period``,
            ``reference_period``, s.

    Raises:
        ControllerError: unknown name, or gains for another number of joints.
    """
    if not isinstance(name, str) or name not in PRESETS:
        raise ControllerError(f"controller.preset = {shown(name)}: must be one of {sorted(PRESETS)}")
    try:
        law, options = PRESETS[name].law, PRESETS[name].options
        return make_controller(law, model, **{**suited(law, known or {}), **options})
    except ControllerError as error:
        raise ControllerError(f"controller.preset = {name!r}: does not fit this model ({error})") from None
