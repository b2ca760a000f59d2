"""Controllers with published gains, by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from skyarm.algebra import Vec3
from skyarm.control.exact import MAKERS
from skyarm.control.model import GeometricGains, JointGains, Model
from skyarm.control.registry import Controller, ControllerError, make_controller
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


def _rotors(model: Model) -> Controller:
    return make_controller("rotors_position", model, gains=HUMMINGBIRD)


def _ct(model: Model) -> Controller:
    return make_controller("hybrid_computed_torque", model, gains=HUMMINGBIRD, joint_gains=ACCELERATION)


def _ct_euler(model: Model) -> Controller:
    return make_controller("hybrid_computed_torque_euler", model, gains=HUMMINGBIRD, joint_gains=ACCELERATION)


def _pd(model: Model) -> Controller:
    return make_controller("decoupled_pd", model, gains=HUMMINGBIRD, joint_gains=TORQUE)


PRESETS: Mapping[str, Callable[[Model], Controller]] = {
    "paper_ct": _ct,
    "paper_ct_euler": _ct_euler,
    "paper_pd": _pd,
    "rotors_hummingbird": _rotors,
}


def preset(name: str, model: Model) -> Controller:
    """A controller with published gains, or the exact law with the gains of one of its presets.

    Raises:
        ControllerError: unknown name, or gains for another number of joints.
    """
    makers = {**PRESETS, **MAKERS}
    if not isinstance(name, str) or name not in makers:
        raise ControllerError(f"controller.preset = {shown(name)}: must be one of {sorted(makers)}")
    try:
        return makers[name](model)
    except ControllerError as error:
        raise ControllerError(f"controller.preset = {name!r}: does not fit this model ({error})") from None
