"""Port to an arm of DYNAMIXEL servos (protocol 2.0, X series) on a serial bus, by the
maker's SDK.

Source: ROBOTIS e-Manual, control table of the X series: addresses, and units of
position (1/4096 turn), velocity (0.229 turns a minute) and current (by the model). A
thread of its own keeps the bus busy; the servos' own watchdog stops them half a second
after the bus falls silent. Setpoints that are not renewed are not sent on: the servos
then hold their places.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import Annotated, Any

from skyarm.links.joint_port import FRESH, JointLink, JointPortError, JointReading
from skyarm.records.field_rules import checked
from skyarm.records.files import needs_extra, shipped_tables, shown
from skyarm.records.immutable import immutable
from skyarm.records.units import Unit, positive

OPERATING_MODE, TORQUE_ENABLE, BUS_WATCHDOG = 11, 64, 98
"""Addresses of one-byte registers."""

GOAL_CURRENT, GOAL_POSITION, PRESENT = 102, 116, 128
"""Addresses of registers: goal current (two bytes), goal position (four), velocity and
position (four each)."""

CURRENT_MODE, POSITION_MODE = 0, 4
"""Operating modes: current, and position over several turns."""

TICK, ZERO = 2.0 * math.pi / 4096.0, 2048
"""Angle (rad) per position count, and position count of joint angle zero."""

RATE = 0.229 * 2.0 * math.pi / 60.0
"""Velocity (rad/s) per count."""

CURRENTS = shipped_tables(__file__)["currents"]
"""Model number -> current (A) per count. Others, as XL430, cannot be told a current, or
count in an unknown unit."""

WATCHDOG = 25
"""Time without a packet after which a servo stops, in units of 20 ms."""


@immutable
@checked("--joints", JointPortError)
class ServoBus:
    """Settings of a serial bus of DYNAMIXEL servos.

    Attributes:
        device: serial port.
        ids: numbers of the servos, in the order of the vehicle's joints.
        torque: torque of each ampere, for setpoints in N m; None for setpoints of
            position in rad.
        most: largest current that is sent.
    """

    device: str
    ids: tuple[int, ...]
    baud: Annotated[int, Unit("1/s", "baud rate of the serial bus", low=9600)] = (
        1_000_000
    )
    torque: Annotated[
        float | None,
        positive(
            "N m/A",
            "torque per ampere of a servo, for setpoints in N m; None for setpoints of"
            " position",
        ),
    ] = None
    most: Annotated[
        float,
        positive(
            "A",
            "largest current sent to a servo",
            effect="lower values protect the servo and limit its torque",
        ),
    ] = 1.2


class DynamixelJoints(JointLink):
    """Joint port to DYNAMIXEL servos, read and commanded by a thread as fast as the bus
    permits.

    Raises:
        JointPortError: the SDK is missing, the port cannot be opened, or a servo does
            not answer.
    """

    def __init__(self, bus: ServoBus) -> None:
        try:
            import dynamixel_sdk as sdk
        except ImportError:
            raise JointPortError(
                "dynamixel_sdk: is missing; --joints dynamixel"
                f" {needs_extra('dynamixel')}"
            ) from None
        self._bus = bus
        # of what is handed over, and of the bus
        self._lock, self._bus_lock = threading.Lock(), threading.Lock()
        self._port: Any = sdk.PortHandler(bus.device)
        self._packets: Any = sdk.PacketHandler(2.0)
        # 8 bytes: velocity and position, four each
        self._states: Any = sdk.GroupSyncRead(self._port, self._packets, PRESENT, 8)
        # goal positions have four bytes, goal currents two
        address, size = (GOAL_POSITION, 4) if bus.torque is None else (GOAL_CURRENT, 2)
        self._goals: Any = sdk.GroupSyncWrite(self._port, self._packets, address, size)
        self._size = size
        self._own_mode = self._mode = (
            POSITION_MODE if bus.torque is None else CURRENT_MODE
        )
        self._currents: list[float] = []
        self._newest: JointReading | None = None
        self._setpoints: tuple[float, ...] | None = None
        self._given = -math.inf
        self._running = True
        self._open_bus()
        self._thread = threading.Thread(
            target=self._serve, name="dynamixel", daemon=True
        )
        self._thread.start()

    def read(self) -> JointReading | None:
        """Newest joint reading from the servo bus since the last call; None if the bus
        has sent none.
        """
        with self._lock:
            newest, self._newest = self._newest, None
        return newest

    def send(self, setpoints: Sequence[float], at: float) -> None:
        """Pass joint setpoints to the servo bus: torques in N m, or positions in
        rad.
        """
        with self._lock:
            self._setpoints, self._given = tuple(setpoints), time.monotonic()

    def release(self) -> None:
        """Command every servo to hold its present position."""
        with self._lock:
            self._setpoints = None
        with self._bus_lock, suppress(OSError):
            self._hold()

    def close(self) -> None:
        """Stop the thread and close the serial port; the servos keep their position."""
        if self._running:
            self._running = False
            # joined before the port is closed, so that no packet is cut; a second,
            # chosen, so that a bus that hangs does not keep the program
            self._thread.join(1.0)
            self._port.closePort()

    def _open_bus(self) -> None:
        bus = self._bus
        try:
            if not (self._port.openPort() and self._port.setBaudRate(bus.baud)):
                raise JointPortError(
                    f"--joints: {shown(bus.device)}: cannot be opened at {bus.baud}"
                    " bits a second"
                )
            self._prepare()
        except BaseException as error:
            # Ctrl-C, too, leaves no port open
            self._shut()
            if isinstance(error, OSError):
                raise JointPortError(
                    f"--joints: {shown(bus.device)}: {error.strerror or error}"
                ) from None
            raise

    def _shut(self) -> None:
        """Close the serial port, even if the SDK failed to open it."""
        with suppress(AttributeError, OSError):
            self._port.closePort()

    def _prepare(self) -> None:
        """Set operating mode and watchdog of every servo, and enable its torque.

        Raises:
            JointPortError: a servo does not answer.
        """
        bus = self._bus
        for number in bus.ids:
            # the operating mode is writable while the torque is off only
            done = self._write(number, TORQUE_ENABLE, 0) and self._write(
                number, OPERATING_MODE, self._mode
            )
            done = (
                done
                # an expired watchdog must be cleared before it accepts another time
                and self._write(number, BUS_WATCHDOG, 0)
                and self._write(number, BUS_WATCHDOG, WATCHDOG)
            )
            model, _, _ = self._packets.ping(self._port, number)
            at = f"--joints: servo {number} on {shown(bus.device)}"
            count = CURRENTS.get(str(model))
            if done and bus.torque and not count:
                raise JointPortError(
                    f"{at}: model {model} counts no known current; without torque it"
                    " takes positions"
                )
            if not (done and self._write(number, TORQUE_ENABLE, 1)):
                raise JointPortError(f"{at} does not answer")
            self._states.addParam(number)
            self._currents.append(count)

    def _write(self, number: int, address: int, value: int) -> bool:
        result, error = self._packets.write1ByteTxRx(self._port, number, address, value)
        return bool(result == 0 and error == 0)

    def _serve(self) -> None:
        """Read the servos and write their setpoints, until the port is closed."""
        while self._running:
            try:
                with self._bus_lock:
                    self._cycle()
            except Exception as error:  # of the SDK, too: the arm is silent from now on
                self.problem = str(error) or type(error).__name__
                return
            # half a millisecond of rest, so that callers get the lock of the bus
            time.sleep(0.0005)

    def _cycle(self) -> None:
        if self._states.txRxPacket() == 0:
            rows = [self._state(number) for number in self._bus.ids]
            # a reading holds all joints: one that is silent leaves out the others, too
            if all(row is not None for row in rows):
                joints, rates = zip(
                    *(row for row in rows if row is not None), strict=True
                )
                with self._lock:
                    self._newest = JointReading(time.monotonic(), joints, rates)
        with self._lock:
            setpoints, old = self._setpoints, time.monotonic() - self._given > FRESH
            if old:
                self._setpoints = None
        if setpoints is not None and old:
            self._hold()
        elif setpoints is not None:
            if self._mode != self._own_mode:  # it held its place while none came
                self._switch(self._own_mode)
            for number, unit, setpoint in zip(
                self._bus.ids, self._currents, setpoints, strict=True
            ):
                # registers hold two's complement of their own width
                ticks = self._ticks(setpoint, unit) & (1 << 8 * self._size) - 1
                self._goals.addParam(number, list(ticks.to_bytes(self._size, "little")))
            self._goals.txPacket()
            self._goals.clearParam()

    def _hold(self) -> None:
        """Command every servo to hold its present position."""
        self._switch(POSITION_MODE)

    def _switch(self, mode: int) -> None:
        """Set the operating mode of every servo, which is possible while its torque is
        off only.
        """
        self._mode = mode
        for number in self._bus.ids:
            self._write(number, TORQUE_ENABLE, 0)
            self._write(number, OPERATING_MODE, mode)
            self._write(number, TORQUE_ENABLE, 1)

    def _state(self, number: int) -> tuple[float, float] | None:
        """Angle and rate of a servo; None if it did not answer."""
        if not self._states.isAvailable(number, PRESENT, 8):
            return None
        velocity, position = (
            _twos_complement(self._states.getData(number, at, 4))
            for at in (PRESENT, PRESENT + 4)
        )
        return (position - ZERO) * TICK, velocity * RATE

    def _ticks(self, setpoint: float, current: float) -> int:
        """Convert a setpoint to the servo's units of position or current (A)."""
        if self._bus.torque is None:
            return round(setpoint / TICK) + ZERO
        amperes = min(max(setpoint / self._bus.torque, -self._bus.most), self._bus.most)
        return round(amperes / current)


def _twos_complement(value: int) -> int:
    """Convert an unsigned 32-bit number to a signed one in two's complement."""
    return value - (1 << 32) if value >= 1 << 31 else value
