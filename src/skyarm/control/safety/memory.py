"""Constants and memory of a law with the safety layer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.actuation import Command, Mixer
from skyarm.algebra import Vec3
from skyarm.control.controller import Controller
from skyarm.control.model import Model
from skyarm.control.safety.limits import Limits
from skyarm.control.safety.recovery import Recovery
from skyarm.control.safety.supervisor import Confidence
from skyarm.records.leaves import blend
from skyarm.records.units import Unit
from skyarm.scalars import Scalar


@dataclass(frozen=True, kw_only=True, slots=True)
class SafetyParameters:
    """Constants of a law with the safety layer: one belief for all, and the law's own constants without theirs.

    Attributes:
        model: belief. mixer: its rotors, with priorities where they allow them.
        limits: of references and commands. recovery: what flies when the law is given up.
        inner: constants of the law; its model and mixer are those above, given to it at each call.
    """

    model: Model
    mixer: Mixer
    limits: Limits
    recovery: Recovery
    inner: Any


@dataclass(frozen=True, kw_only=True, slots=True)
class SafetyMemory:
    """State of a law with the safety layer between two steps.

    Attributes:
        inner: memory of the law.
        started: 0 before the first step.
        joints: rad or m, governed references of the law. ramping: 1 where one is on its way.
        arm: those of the recovery.
        sent: the last command.
        confidence: of the law. hold: m, where the recovery hovers. yaw: rad, its heading.
    """

    inner: Any
    started: Annotated[Scalar, Unit("", "0 before the first step")]
    joints: Annotated[tuple[Scalar, ...], Unit("rad or m", "governed references of the law")]
    ramping: Annotated[tuple[Scalar, ...], Unit("", "1 for each joint whose reference is on its way")]
    arm: Annotated[tuple[Scalar, ...], Unit("rad or m", "references of the recovery")]
    sent: Command
    confidence: Confidence
    hold: Annotated[Vec3, Unit("m", "where the recovery hovers, world axes")]
    yaw: Annotated[Scalar, Unit("rad", "heading in the recovery")]


def first_memory(controller: Controller) -> SafetyMemory:
    """Return the memory of a controller with the safety layer before its first step."""
    vehicle = controller.par.model.vehicle
    still = (0.0,) * vehicle.n
    return SafetyMemory(
        inner=controller.memory,
        started=0.0,
        joints=still,
        ramping=still,
        arm=still,
        sent=Command(rotor_speeds=(0.0,) * len(vehicle.rotors), efforts=still),
        confidence=Confidence(given_up=0.0, outside=0.0, calm=0.0),
        hold=Vec3(0.0, 0.0, 0.0),
        yaw=0.0,
    )


def blend_dense(condition: Any, new: Any, old: Any) -> Any:
    """``new`` where the condition holds, else ``old``, leaf by leaf; a command's structural zeros are data."""
    return blend(condition, _dense(new), _dense(old))


def _dense(record: Any) -> Any:
    """A command with structural zeros as data, as a law with free joints sends them; other records as they are."""
    if not isinstance(record, Command):
        return record
    data = (tuple(float(v) if type(v) is int else v for v in row) for row in (record.rotor_speeds, record.efforts))
    return Command(**dict(zip(("rotor_speeds", "efforts"), data, strict=True)))
