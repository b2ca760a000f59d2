"""MAVLink conversation with an autopilot: commands and parameters to it; mode, position
and texts from it.

Source: mavlink.io, services "Heartbeat", "Command" and "Parameter"; PX4 v1.17 and
ArduCopter 4.7 for the numbers of their modes. On the wire axes are north, east, down;
here north, west, up.
"""

from __future__ import annotations

import math
import struct
import time
from collections.abc import Callable, Mapping

from skyarm.algebra.frames import to_our_axes
from skyarm.links import mavlink
from skyarm.links.mavlink_messages import DEFINITIONS, FieldValue
from skyarm.records.immutable import immutable

TAKE_OFF, SET_MODE, ARM, SET_INTERVAL = 22, 176, 400, 511
"""MAVLink command numbers."""

GROUND_STATION, ONBOARD_COMPUTER = 6, 18
"""MAVLink's types of a ground station and of an onboard computer."""

NO_AUTOPILOT, ACTIVE, CRITICAL = 8, 4, 5
"""Values in a heartbeat: type of a sender that is no autopilot; system status in
flight, and in failsafe."""

ARMED = 128
"""Bit of a heartbeat's mode for an armed vehicle."""

NOTICE = 5
"""MAVLink's severity of a notice; less severe texts are dropped."""

WHOLE, REAL = 6, 9
"""MAVLink's types of a 32-bit integer and of a 32-bit float parameter."""


@immutable
class ModeNumbers:
    """MAVLink mode numbers of an autopilot: the mode for external set points, and the
    hold mode.

    Attributes:
        title: name of the autopilot. hover: its parameter of the thrust set point in
            hover.
        word: its name of the mode for set points from outside.
        outside, hold: parameters 2 and 3 of the mode command.
        shift: bits by which a heartbeat's mode is moved; what is beyond them by 8 is
            the second parameter.
        option: parameter and bit without which the thrust of a set point is a climb
            rate; None where it is a thrust.
        bitwise: True where the bits of a whole-numbered parameter stand in place of a
            float's.
        fastest: rate of a message beyond which a request is refused, Hz.
    """

    title: str
    hover: str
    word: str
    outside: tuple[int, int]
    hold: tuple[int, int]
    shift: int = 0
    option: tuple[str, int] | None = None
    bitwise: bool = False
    fastest: float = math.inf

    def main(self, custom_mode: int) -> int:
        """Main mode number in a heartbeat's ``custom_mode``, without its sub-mode."""
        return custom_mode >> self.shift & 255

    def is_outside(self, custom_mode: int) -> bool:
        """True if a heartbeat's mode takes external set points."""
        return custom_mode == self._custom(self.outside)

    def is_hold(self, custom_mode: int) -> bool:
        """True if a heartbeat's mode holds the position."""
        return custom_mode == self._custom(self.hold)

    def _custom(self, numbers: tuple[int, int]) -> int:
        return numbers[0] << self.shift | numbers[1] << 24


PX4_NUMBER, ARDUPILOT_NUMBER = 12, 3
"""MAVLink's numbers of autopilots."""

MODES: Mapping[int, ModeNumbers] = {
    PX4_NUMBER: ModeNumbers(
        title="PX4",
        hover="MPC_THR_HOVER",
        word="offboard",
        outside=(6, 0),
        hold=(4, 3),
        shift=16,
        bitwise=True,
    ),
    ARDUPILOT_NUMBER: ModeNumbers(
        title="ArduPilot",
        hover="MOT_THST_HOVER",
        word="guided",
        outside=(4, 0),
        hold=(17, 0),
        option=("GUID_OPTIONS", 8),
        fastest=250.0,
    ),
}
"""MAVLink's number of an autopilot -> its modes: PX4's offboard and hold, ArduCopter's
guided and brake."""


class MavlinkVehicle:
    """Autopilot at the other end of a MAVLink connection.

    Args:
        kinds: modes of the autopilots that it may be, by MAVLink's number.
        carry: called with each frame to send.
        sender: our numbers of system and component, by default the usual ones of a
            ground station in MAVLink; system 0 for the autopilot's own.
        role: MAVLink's type of ours.
        system: number of the autopilot; 0 for that of the first heartbeat.
        datagrams: True where whole frames arrive.

    Attributes:
        parser: parser of its messages.
        modes: its mode numbers, None before its first heartbeat.
        system: its number, 0 before its first heartbeat.
        beaten: s of the monotonic clock of its newest heartbeat.
        mode, armed, status: numbers of the newest heartbeat.
        place: newest of finite numbers in its local frame, m; None before the first.
        said: newest text. parameters: values that were requested, by name.
    """

    def __init__(
        self,
        kinds: Mapping[int, ModeNumbers],
        carry: Callable[[bytes], None],
        *,
        sender: tuple[int, int] = (255, 190),
        role: int = GROUND_STATION,
        system: int = 0,
        datagrams: bool = False,
    ) -> None:
        self._kinds, self._carry, self._sender, self._role = kinds, carry, sender, role
        self.parser, self._sequence = mavlink.Parser(datagrams=datagrams), 0
        self.modes: ModeNumbers | None = None
        self.system, self.beaten = system, -math.inf
        self.mode, self.armed, self.status = 0, False, 0
        self.place: tuple[float, float, float] | None = None
        self.said = ""
        self.parameters: dict[str, float] = {}
        self._requested: set[str] = set()

    @property
    def title(self) -> str:
        """Name of the autopilot; empty before its first heartbeat."""
        return "" if self.modes is None else self.modes.title

    @property
    def obeys(self) -> bool:
        """True if the autopilot is in the mode that takes external set points."""
        return self.modes is not None and self.modes.is_outside(self.mode)

    @property
    def holds(self) -> bool:
        """True if the autopilot is in the mode that holds its position."""
        return self.modes is not None and self.modes.is_hold(self.mode)

    def tell(self, name: str, **fields: FieldValue) -> None:
        """Send a MAVLink message.

        Raises:
            MavlinkError: a value that does not fit.
        """
        system, component = self._sender
        frame = mavlink.pack(
            name,
            sequence=self._sequence,
            # system 0 is a broadcast, which is no sender: 1 until the autopilot is
            # heard
            system=system or max(self.system, 1),
            component=component,
            **fields,
        )
        self._sequence += 1
        self._carry(frame)

    def tell_autopilot(self, name: str, **fields: FieldValue) -> None:
        """Send a message that is addressed to the autopilot."""
        self.tell(name, target_system=self.system, target_component=1, **fields)

    def beat(self) -> None:
        """Send the autopilot a MAVLink heartbeat."""
        self.tell(
            "HEARTBEAT", type=self._role, autopilot=NO_AUTOPILOT, system_status=ACTIVE
        )

    def command(self, number: int, *values: float) -> None:
        """Send the autopilot a MAVLink command with its parameters."""
        self.tell_autopilot(
            "COMMAND_LONG",
            command=number,
            **{f"param{i + 1}": float(v) for i, v in enumerate(values)},
        )

    def request_outside(self) -> None:
        """Request the autopilot's mode that takes external set points."""
        assert self.modes is not None
        # 1: the numbers are those of the autopilot's own modes (a flag of MAVLink)
        self.command(SET_MODE, 1, *self.modes.outside)

    def request_hold(self) -> None:
        """Request the autopilot's mode that holds the position."""
        assert self.modes is not None
        self.command(SET_MODE, 1, *self.modes.hold)

    def request_streams(self, rates: Mapping[str, float]) -> None:
        """Request message streams at given rates (Hz)."""
        for name, rate in rates.items():
            self.command(SET_INTERVAL, DEFINITIONS[name].number, round(1e6 / rate))

    def request_parameter(self, name: str) -> None:
        """Request a parameter; its value appears in ``parameters`` once it has
        arrived.
        """
        self._requested.add(name)
        self.tell_autopilot("PARAM_REQUEST_READ", param_index=-1, param_id=name)

    def set_parameter(self, name: str, value: float) -> None:
        """Set a real-valued parameter of the autopilot."""
        self.tell_autopilot(
            "PARAM_SET", param_id=name, param_value=value, param_type=REAL
        )

    def hear(self, message: mavlink.Message) -> bool:
        """Store the contents of a message from the autopilot; False for a message of
        another sender.
        """
        name = message.name
        # the first autopilot that beats is the one: its number is not known before
        unknown = name == "HEARTBEAT" and not self.system
        # component 1 of a system is its autopilot
        if message.component != 1 or not (unknown or message.system == self.system):
            return False
        if name == "HEARTBEAT":
            modes = self._kinds.get(message["autopilot"])
            if modes is None:
                return False
            # the kind of the first heartbeat stays: another one's numbers mean others
            self.modes = self.modes or modes
            self.system = message.system
            self.beaten = time.monotonic()
            self.mode = message["custom_mode"]
            self.armed = bool(message["base_mode"] & ARMED)
            self.status = message["system_status"]
        elif name == "LOCAL_POSITION_NED":
            x, y, z = to_our_axes(message["x"], message["y"], message["z"])
            self.place = (x, y, z) if all(map(math.isfinite, (x, y, z))) else self.place
        elif name == "STATUSTEXT" and message["severity"] <= NOTICE:
            self.said = message["text"]
        elif name == "PARAM_VALUE" and message["param_id"] in self._requested:
            value = float(message["param_value"])
            if (
                self.modes is not None
                and self.modes.bitwise
                and message["param_type"] == WHOLE
            ):
                # PX4 sends the bits of a whole number in place of those of a float
                value = float(*struct.unpack("<i", struct.pack("<f", value)))
            self.parameters[message["param_id"]] = value
        return True
