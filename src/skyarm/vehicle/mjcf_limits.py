"""Where MJCF says more than a vehicle's records can: refused by name where it moves something, else noted."""

from __future__ import annotations

from typing import Any

from skyarm.vehicle.check import refuse
from skyarm.vehicle.notes import Notes

SPRINGS = ("jnt_stiffness", "jnt_stiffnesspoly")
CURVES = ("dof_dampingpoly",)


def name_of(model: Any, kind: str, index: int) -> str:
    """Name of an element, made up from its number where the file gives none."""
    return str(getattr(model, kind)(index).name) or f"{kind}{index}"


def refuse_what_is_not_here(model: Any, notes: Notes) -> None:
    """Refuse springs, balls, closed chains, tendons that pull, soft bodies; note what says nothing of the vehicle.

    Raises:
        VehicleError: the first of them.
    """
    for joint in range(int(model.njnt)):
        _refuse_springs(model, joint)
    _refuse_equalities(model)
    for tendon in range(int(model.ntendon)):
        pulls = ("tendon_stiffness", "tendon_damping", "tendon_frictionloss", "tendon_limited", "tendon_armature")
        name = name_of(model, "tendon", tendon)
        if any(_any(getattr(model, each)[tendon]) for each in pulls):
            refuse(f"tendon[{name}]", "a pull of its own", "must pull nothing; tendons are not supported")
        notes.add("not read", name, "tendon")
    for body in range(1, int(model.nbody)):
        if model.body_gravcomp[body]:
            refuse(f"body[{name_of(model, 'body', body)}].gravcomp", float(model.body_gravcomp[body]), "must be 0")
    if model.nflex:
        refuse("flex", int(model.nflex), "must be rigid bodies only")
    for actuator in range(int(model.nu)):
        _note_actuator(model, actuator, notes)
    if model.opt.density or model.opt.viscosity:
        notes.add("density and viscosity of the option are not read; [drag] and the scenario's air say that")


def _refuse_springs(model: Any, joint: int) -> None:
    import mujoco

    field = f"joint[{name_of(model, 'jnt', joint)}]"
    if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_BALL:
        refuse(f"{field}.type", "ball", "must be 'hinge' or 'slide'; or three hinges in one body")
    if any(_any(getattr(model, name)[joint]) for name in SPRINGS):
        refuse(f"{field}.stiffness", _first(model.jnt_stiffness[joint]), "must be 0; springs are not supported")
    if any(_any(getattr(model, name)[int(model.jnt_dofadr[joint])]) for name in CURVES):
        refuse(f"{field}.damping", "a polynomial", "must be one number")


def _note_actuator(model: Any, actuator: int, notes: Notes) -> None:
    import mujoco

    name, kinds = name_of(model, "actuator", actuator), mujoco.mjtTrn
    if _any(model.actuator_armature[actuator]) or _any(model.actuator_damping[actuator]):
        refuse(f"actuator[{name}]", "armature or damping of its own", "must be stated at its joint")
    kind = int(model.actuator_trntype[actuator])
    if kind == kinds.mjTRN_SITE:
        notes.add("at a site, not read; rotors are stated in [[rotors]]", name, "actuator")
    elif kind not in (kinds.mjTRN_JOINT, kinds.mjTRN_JOINTINPARENT):
        notes.add("not at a joint, so not read", name, "actuator")


def _refuse_equalities(model: Any) -> None:
    import mujoco

    kinds = mujoco.mjtEq
    names = {int(kinds.mjEQ_CONNECT): "connect", int(kinds.mjEQ_WELD): "weld"}
    for each in range(int(model.neq)):
        kind = int(model.eq_type[each])
        if not model.eq_active0[each] or kind == kinds.mjEQ_JOINT:
            continue
        allowed = "closed chains are not supported" if kind in names else "only equalities of joints are supported"
        refuse(f"equality[{each}]", names.get(kind, "of another kind"), allowed)


def _any(value: Any) -> bool:
    import numpy as np

    return bool(np.any(np.asarray(value)))


def _first(value: Any) -> float:
    import numpy as np

    return float(np.asarray(value).ravel()[0])
