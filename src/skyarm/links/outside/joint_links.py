"""Opening of a joint port by its address: a socket, a servo bus, or the user's own
function.
"""

from __future__ import annotations

from urllib.parse import parse_qs, urlsplit

from skyarm.links.joint_port import JointLink, JointPortError, NoJoints, UdpJoints
from skyarm.links.outside.dynamixel import DynamixelJoints, ServoBus
from skyarm.records.files import shown
from skyarm.records.registry import load_plugin
from skyarm.records.registry.plugins import FROM_FILE
from skyarm.vehicle import Vehicle

OPTIONS = ("ids", "baud", "torque", "most")
"""Options of a servo bus."""


def open_joints(url: str | None, vehicle: Vehicle) -> JointLink:
    """Open the joint port at a given address, for a vehicle's joints.

    Args:
        url: ``udp://HOST:PORT``; ``dynamixel:DEVICE?ids=1,2&torque=1.8`` with the
            torque of an ampere, N m, for joints that take torques; or ``FILE.py:make``,
            whose ``make(vehicle)`` returns a :class:`JointLink`.
        vehicle: law's vehicle.

    Raises:
        JointPortError: no address for a vehicle with joints, another form, or a port
            that cannot be opened.
        RegistryError: a file that cannot be loaded.
    """
    if not vehicle.n:
        return NoJoints()
    if url is None:
        raise JointPortError(
            f"--joints: is missing, must be given for the {vehicle.n} joints of"
            f" {vehicle.name!r}"
        )
    # a file's colon would parse as a scheme, so the user's own form is tried first
    match = FROM_FILE.fullmatch(url)
    if match is not None:
        return _open_own(match["file"], match["maker"], vehicle)
    scheme, host, port, path = _parts(url)
    if scheme == "udp" and host and port and not path:
        return UdpJoints(host, port, vehicle.n)
    if scheme == "dynamixel" and path:
        return DynamixelJoints(_servo_bus(url, vehicle))
    raise JointPortError(
        f"--joints = {shown(url)}: must be udp://HOST:PORT, dynamixel:DEVICE?ids=1,2 or"
        " FILE.py:make"
    )


def _parts(url: str) -> tuple[str, str, int, str]:
    """Scheme, host, port and path of an address; empty parts if missing or invalid."""
    try:
        parts = urlsplit(url)
        return parts.scheme, parts.hostname or "", parts.port or 0, parts.path
    except ValueError:
        return "", "", 0, ""


def _open_own(file: str, maker: str, vehicle: Vehicle) -> JointLink:
    """Joint port made by a user's function.

    Raises:
        JointPortError: no such function, or one that returns something else.
    """
    make = getattr(load_plugin(file), maker, None)
    if not callable(make):
        raise JointPortError(
            f"--joints = {shown(f'{file}:{maker}')}: {file} must have a function"
            f" {maker!r}"
        )
    link = make(vehicle)
    if not isinstance(link, JointLink):
        raise JointPortError(
            f"--joints = {shown(f'{file}:{maker}')}: {maker} must return a JointLink"
        )
    return link


def _servo_bus(url: str, vehicle: Vehicle) -> ServoBus:
    """Servo bus settings from the address of the bus.

    Raises:
        JointPortError: options that are unknown or missing, or do not fit the vehicle.
    """
    parts = urlsplit(url)
    given = {name: values[-1] for name, values in parse_qs(parts.query).items()}
    unknown = [name for name in given if name not in OPTIONS]
    at = f"--joints = {shown(url)}"
    if unknown:
        raise JointPortError(
            f"{at}: {shown(unknown[0])} must be one of {list(OPTIONS)}"
        )
    try:
        ids = tuple(map(int, given.get("ids", "").split(",")))
        baud, most = int(given.get("baud", 1_000_000)), float(given.get("most", 1.2))
        torque = float(given["torque"]) if "torque" in given else None
    except ValueError:
        raise JointPortError(
            f"{at}: must have numbers: ids=1,2&baud=1000000&torque=1.8&most=1.2"
        ) from None
    if (
        len(ids) != vehicle.n
        or len({*ids}) != len(ids)
        # 253 and 254 are reserved by the protocol, 254 is the broadcast
        or not all(0 <= each <= 252 for each in ids)
    ):
        raise JointPortError(
            f"{at}: ids must be {vehicle.n} different numbers from 0 to 252, one for"
            " each joint"
        )
    setpoints = {
        each.name: each.drive.takes
        for each in vehicle.drives
        if not each.drive.takes_torque
    }
    takes = {setpoints.get(joint.name, "N m or N") for joint in vehicle.joints}
    if takes == {"N m or N"} and torque is None:
        raise JointPortError(
            f"{at}: torque must be given, N m of an ampere, for joints that take"
            " torques"
        )
    if takes != {"N m or N"} and (
        torque is not None or any(not each.startswith("rad or") for each in takes)
    ):
        raise JointPortError(
            f"{at}: must be joints that all take torques, or all take positions without"
            " a torque"
        )
    return ServoBus(device=parts.path, ids=ids, baud=baud, torque=torque, most=most)
