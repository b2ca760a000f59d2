"""Options of the centroidal law for contact, load and admittance, and the parts made
from these options.
"""

from __future__ import annotations

from skyarm.control.blocks.force_control import SENSING, require_thresholds
from skyarm.control.blocks.torque_scale import Tolerances
from skyarm.control.controller import ControllerError, LawOptions, OptionRanges
from skyarm.control.laws.centroidal.contact.admittance import admittance_gains
from skyarm.control.laws.centroidal.contact.carrying import CarryingGains
from skyarm.control.laws.centroidal.contact.interaction import Interaction
from skyarm.control.laws.centroidal.contact.load import load_gains
from skyarm.control.laws.centroidal.parameters import OptionalPart
from skyarm.records.files import shown
from skyarm.vehicle import Vehicle

OPTIONS: OptionRanges = {
    "interaction": ((0.0, 0.0), 0.0, 1e3),
    "tolerances": ((0.0, 0.0), 0.0, 1.0),
    "force_sensor": (False, 0.0, 1.0),
    "load": (0.0, 0.0, 1e3),
    "carrying": (0.0, 0.0, 10.0),
    "carried_inertia": (0.0, 0.0, 1.0),
}
"""Default value and range of each contact option; the defaults disable contact
control."""


def must_act(gains: LawOptions, admittance: LawOptions | None) -> None:
    """Reject options that have no effect because another option is missing."""
    presses = any(gains["interaction"])
    if gains["force_sensor"] and admittance is None and not presses:
        raise ControllerError(
            "controller.force_sensor = true: must be false without interaction"
        )
    if gains["carried_inertia"] and not gains["carrying"]:
        raise ControllerError(
            f"controller.carried_inertia = {shown(gains['carried_inertia'])}: must be 0"
            " without carrying"
        )
    if any(gains["tolerances"]) and not presses:
        at = f"controller.tolerances = {shown(gains['tolerances'])}"
        raise ControllerError(f"{at}: must be twice 0 without interaction")


def contact_parts(
    gains: LawOptions,
    admittance: LawOptions | None,
    vehicle: Vehicle,
    *,
    leads: bool,
    lead: float,
    periods: int,
) -> dict[str, OptionalPart]:
    """Parts of the centroidal law for contact force control, admittance, load estimate
    and carrying, by name.
    """
    parts: dict[str, OptionalPart] = {}
    if any(gains["interaction"]):
        parts["interaction"] = _interaction(gains, vehicle, leads=leads)
    if admittance is not None:
        parts["admittance"] = admittance_gains(admittance, gains, leads, lead)
    if gains["load"]:
        parts["load"] = load_gains(gains["load"], vehicle)
    if gains["carrying"]:
        parts["carrying"] = _carrying(
            gains, leads=leads or not vehicle.n, periods=periods
        )
    return parts


def _carrying(gains: LawOptions, *, leads: bool, periods: int) -> CarryingGains:
    """Constants of the carrying part; a law whose arm leads no tip, and one that learns
    or presses, is refused.
    """
    at = f"controller.carrying = {shown(gains['carrying'])}"
    if not leads:
        raise ControllerError(
            f"{at}: must be 0 but in mode 'tip' with joints, or without joints"
        )
    for name in ("interaction", "load"):
        if gains[name] not in (0.0, (0.0, 0.0)):
            raise ControllerError(f"{at}: must be 0 beside {name}")
    return CarryingGains(
        bandwidth=gains["carrying"],
        inertia=gains["carried_inertia"] or 0,
        delay_periods=periods,
    )


def _interaction(gains: LawOptions, vehicle: Vehicle, *, leads: bool) -> Interaction:
    """Constants of contact force control from the law's options."""
    require_thresholds(gains["interaction"], leads)
    if not gains["tip"][1]:
        raise ControllerError(
            f"controller.tip[1] = {shown(gains['tip'][1])}: must be above 0 with"
            " interaction"
        )
    (touch, lost), (torques, masses) = gains["interaction"], gains["tolerances"]
    geared = any(float(joint.armature) > 0.0 for joint in vehicle.joints)
    return Interaction(
        touch=touch,
        lost=lost,
        sensing=SENSING if gains["force_sensor"] else None,
        tolerances=(
            Tolerances(torques=torques, masses=masses) if torques or masses else None
        ),
        geared=geared,
    )
