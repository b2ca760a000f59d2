"""Controllers with published gains, by name."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from skyarm.algebra import Vec3
from skyarm.control.catalogue.law_entries import make_controller, suitable_options
from skyarm.control.controller import Controller, ControllerError
from skyarm.control.model import GeometricGains, JointGains, Model
from skyarm.files import must_be_one_of, shown
from skyarm.files.old_names import warn_of_old_name

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


ALIASES: Mapping[str, str] = {
    "exact_joint": "centroidal_joint",
    "exact_joint_stiff": "centroidal_joint_stiff",
    "exact_ee": "centroidal_tip",
    "exact_ee_stiff": "centroidal_tip_stiff",
}
"""Other names that stay."""

OLD_NAMES: Mapping[str, str] = {"rotors_hummingbird": "rotors_sim_hummingbird"}
"""Names of the last version, which work with a warning."""

_SHIPPED: Mapping[str, Preset] = {
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
    "rotors_sim_hummingbird": Preset(
        "RotorS's controller with its Hummingbird's gains, joints free", "rotors_sim_position", {"gains": HUMMINGBIRD}
    ),
    "centroidal_joint": Preset(
        "the centroidal law, base and joints on their references",
        "centroidal",
        {"mode": "joint", "preset": "adaptive"},
    ),
    "centroidal_joint_gusts": Preset(
        "the centroidal law for gusts, which must hear an accelerometer, base and joints on their references",
        "centroidal",
        {"mode": "joint", "preset": "gusts"},
    ),
    "centroidal_joint_stiff": Preset(
        "the centroidal law, base and joints on their references, for perfect state",
        "centroidal",
        {"mode": "joint", "preset": "stiff"},
    ),
    "centroidal_tip": Preset(
        "the centroidal law, the tip on its reference", "centroidal", {"mode": "tip", "preset": "adaptive"}
    ),
    "centroidal_joint_robust": Preset(
        "the centroidal law as it was in 0.1, base and joints on their references",
        "centroidal",
        {"mode": "joint", "preset": "robust"},
    ),
    "centroidal_tip_robust": Preset(
        "the centroidal law as it was in 0.1, the tip on its reference",
        "centroidal",
        {"mode": "tip", "preset": "robust"},
    ),
    "centroidal_tip_gusts": Preset(
        "the centroidal law for gusts, which must hear an accelerometer, the tip on its reference",
        "centroidal",
        {"mode": "tip", "preset": "gusts"},
    ),
    "centroidal_tip_stiff": Preset(
        "the centroidal law, the tip on its reference, for perfect state",
        "centroidal",
        {"mode": "tip", "preset": "stiff"},
    ),
}


class _Presets(Mapping[str, Preset]):
    """The presets by name, and by alias or old name."""

    def __getitem__(self, name: str) -> Preset:
        """A preset by any of its names; KeyError for an unknown one."""
        return _SHIPPED[_canonical(name)]

    def __iter__(self) -> Iterator[str]:
        return iter(_SHIPPED)

    def __len__(self) -> int:
        return len(_SHIPPED)


PRESETS: Mapping[str, Preset] = _Presets()
"""The paper's controllers with its gains, and the centroidal law with its own; iteration leaves aliases out."""


def preset(name: str, model: Model, known: Mapping[str, Any] | None = None) -> Controller:
    """Make a controller by the name of a preset.

    Args:
        name: a key of ``PRESETS``, an alias or an old name of one.
        model: what it believes.
        known: what a law may know of its loop, as far as it has such options: ``delay``, ``control_period``,
            ``reference_period``, s.

    Raises:
        ControllerError: unknown name, or gains for another number of joints.
    """
    if not isinstance(name, str) or name not in PRESETS:
        raise ControllerError(f"controller.preset = {shown(name)}: {must_be_one_of(PRESETS, name, 'skyarm list')}")
    name = canonical_preset(name)
    try:
        law, options = PRESETS[name].law, PRESETS[name].options
        return make_controller(law, model, **{**suitable_options(law, known or {}), **options})
    except ControllerError as error:
        raise ControllerError(f"controller.preset = {name!r}: does not fit this model ({error})") from None


def canonical_preset(name: Any) -> Any:
    """The preset's own name where an alias or an old name is given, with a warning for an old one."""
    if isinstance(name, str) and name in OLD_NAMES:
        warn_of_old_name(f"preset {name!r}", repr(OLD_NAMES[name]), stacklevel=3)
    return _canonical(name) if isinstance(name, str) else name


def _canonical(name: str) -> str:
    return ALIASES.get(name) or OLD_NAMES.get(name, name)
