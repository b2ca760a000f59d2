"""The paper's laws as controllers: gains scaled to the model, ablations, where the law is defined."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from skyarm.actuation import Command
from skyarm.control.blocks.default_gains import fitting_gains, fitting_mixer
from skyarm.control.blocks.geometric import OLD_RATE_ERRORS, RATE_ERRORS
from skyarm.control.blocks.joint_friction import shares
from skyarm.control.controller import Controller, ControllerError, Law
from skyarm.control.laws.paper import computed_torque as laws
from skyarm.control.model import GeometricGains, JointGains, Model, Parameters, Terms
from skyarm.files import shown
from skyarm.files.old_names import renamed
from skyarm.records.leaves import parts
from skyarm.reference import Reference
from skyarm.sensors.measurement import Measurement


def hybrid_computed_torque_euler(
    memory: Any, measurement: Measurement, reference: Reference, dt: Any, *, par: Parameters
) -> tuple[Any, Command]:
    """The law in the paper's Euler-angle equations, which are read when they are first flown.

    Source: Barakou et al. 2026, eq. (86)-(96).
    """
    from skyarm.control.laws.paper import euler_form as euler

    return euler.hybrid_computed_torque_euler(memory, measurement, reference, dt, par=par)


PAPER_LAWS: Mapping[str, Law] = {
    "rotors_sim_position": laws.rotors_sim_position,
    "decoupled_pd": laws.decoupled_pd,
    "hybrid_computed_torque": laws.hybrid_computed_torque,
    "hybrid_computed_torque_euler": hybrid_computed_torque_euler,
}

ABLATIONS: Mapping[str, tuple[str, ...]] = {
    "rotors_sim_position": (),
    "decoupled_pd": (),
    "hybrid_computed_torque": ("coriolis", "coupling", "full_gravity", "feedforward"),
    "hybrid_computed_torque_euler": ("coriolis", "feedforward"),
}
"""The terms of :class:`skyarm.control.model.Terms` that each law can leave out."""


def make_paper_controller(
    model: Model,
    *,
    name: str,
    gains: GeometricGains | None = None,
    joint_gains: JointGains | None = None,
    mixer_policy: str = "clip",
    rate_error: str = "rotors_sim",
    terms: Terms | None = None,
    friction_compensation: Sequence[float] | None = None,
    rate_weights: Sequence[float] | None = None,
) -> Controller:
    """One of the paper's laws as a controller.

    Args:
        model: what it believes.
        name: a key of ``PAPER_LAWS``.
        gains: of the base; RotorS's Hummingbird's scaled to the model if left out.
        joint_gains: of the joints; :func:`default_joint_gains` if left out.
        mixer_policy: see :class:`skyarm.actuation.Mixer`.
        rate_error: see :func:`skyarm.control.blocks.geometric.rate_error`.
        terms: ablation of the computed torque.
        friction_compensation: for each joint, the share of its believed friction that its torque gives back, behind
            the inertia matrix; none if left out.
        rate_weights: for each joint, what its desired rate counts in the difference of rates; 1 if left out.

    Raises:
        ControllerError: unknown rate error, gains or shares that do not fit the joints, or an ablation or a share the
            law does not know.
        AllocationError: the model's rotors do not span torque and thrust.
    """
    rate_error = renamed("controller.rate_error", rate_error, OLD_RATE_ERRORS)
    if rate_error not in RATE_ERRORS:
        raise ControllerError(f"controller.rate_error = {shown(rate_error)}: must be one of {', '.join(RATE_ERRORS)}")
    if name == "hybrid_computed_torque_euler":
        from skyarm.control.laws.paper.euler_form import require_paper_vehicle

        try:
            require_paper_vehicle(model.vehicle)
        except ValueError as error:
            raise ControllerError(f"controller.law = {name!r}: {error}") from None
    if terms is not None and not isinstance(terms, Terms):
        raise ControllerError(f"controller.terms = {shown(terms)}: must be Terms")
    _require_known_terms(name, terms or Terms())
    gains, joint_gains = fitting_gains(name, model, gains, joint_gains)
    of_joints = {"friction_compensation": friction_compensation, "rate_weights": rate_weights}
    for option, value in of_joints.items():
        if name == "rotors_sim_position" and value:
            raise ControllerError(f"controller.{option} = {shown(value)}: {name!r} gives joints no torque")
    par = Parameters(
        model=model,
        gains=gains,
        joint_gains=joint_gains,
        mixer=fitting_mixer(model, mixer_policy),
        rate_error=rate_error,
        terms=terms or Terms(),
        **{option: shares(option, value, model.vehicle.n) for option, value in of_joints.items()},
    )
    if name == "hybrid_computed_torque_euler":
        return Controller(name=name, law=PAPER_LAWS[name], par=par, margin=_euler_margin, limit=EULER_LIMIT)
    return Controller(name=name, law=PAPER_LAWS[name], par=par)


def _require_known_terms(name: str, terms: Terms) -> None:
    """An ablation that a law would silently fly without is refused."""
    taken = [name for name, kept in parts(terms).items() if not kept]
    for field in taken:
        if field not in ABLATIONS[name]:
            raise ControllerError(
                f"controller.terms.{field} = False: '{name}' has no such term to leave out; it can leave out "
                f"{list(ABLATIONS[name]) or 'nothing'}"
            )


EULER_LIMIT = "pitch near 90 degrees: Euler angles are singular; use hybrid_computed_torque (body coordinates)"


def _euler_margin(quaternion: Any) -> Any:
    from skyarm.control.laws.paper import euler_form as euler

    return euler.distance_to_singularity(quaternion) - euler.SINGULAR_COSINE * euler.SINGULAR_COSINE
