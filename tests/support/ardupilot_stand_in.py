"""Stand-in for ArduCopter in tests: its JSON physics and MAVLink, a hover law of a
quadrotor +, and faults on demand.

Run as the program, with ArduPilot's arguments. It takes gains and hover thrust from the
defaults file, as ArduPilot does, so that wrong ones do not fly. Environment:
STAND_IN_FAULT names a fault and STAND_IN_FRAME its frame; STAND_IN_NOTE is a file that
gets its process number and what it was told.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import socket
import struct
import sys
import time
from pathlib import Path

from skyarm.links import mavlink

FAULT, AT = (
    os.environ.get("STAND_IN_FAULT", ""),
    int(os.environ.get("STAND_IN_FRAME", "300")),
)
WIDE = FAULT == "wide"
READY = 1.0
"""s after which the estimates are valid."""

ROLL, PITCH, YAW = (-1.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, -1.0), (1.0, 1.0, -1.0, -1.0)
"""Shares of the motors of a quadrotor +: right and left, counter-clockwise, front and
back, clockwise."""


def option(name: str) -> str:
    """Value of a command-line option."""
    return sys.argv[sys.argv.index(name) + 1]


class StandIn:
    """State of the stand-in: mode, arming, place of its local origin, and set point."""

    def __init__(self) -> None:
        self.parameters = dict(
            line.split() for line in Path(option("--defaults")).read_text().splitlines()
        )
        assert option("--serial0").startswith("tcpclient:127.0.0.1:")
        self.mavlink = socket.create_connection(
            ("127.0.0.1", int(option("--serial0").rsplit(":", 1)[1]))
        )
        self.mavlink.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.mavlink.setblocking(False)
        self.physics = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.physics.connect(("127.0.0.1", int(option("--sim-port-out"))))
        self.parser, self.sequence, self.frame = mavlink.Parser(), 0, 0
        self.mode, self.armed, self.height = 0, False, None
        self.origin, self.goal, self.told = None, None, []
        self.pulses = [1000] * (32 if WIDE else 16)
        self.asked: set[int] = set()
        self.beat, self.deaf, self.clock = 0, False, 0.0

    def number(self, name: str) -> float:
        """Parameter's value."""
        return float(self.parameters[name])

    def tell(self, name: str, **fields: object) -> None:
        """Send a message as system 1."""
        self.mavlink.setblocking(True)
        self.mavlink.sendall(
            mavlink.pack(
                name, sequence=self.sequence & 255, system=1, component=1, **fields
            )
        )
        self.mavlink.setblocking(False)
        self.sequence += 1

    def hear(self, message: mavlink.Message) -> None:
        """Obey a command or a set point, as ArduPilot does: nothing out of order."""
        if message.name == "COMMAND_LONG":
            number, first = message["command"], message["param1"]
            self.told.append(number)
            if number == 511:
                self.asked.add(int(first))
            elif number == 176 and first == 1:
                self.mode = int(message["param2"])
            elif number == 400:
                if self.mode == 4 and self.origin is not None:
                    self.armed = True
                else:
                    self.tell("STATUSTEXT", severity=2, text="Arm: not in guided mode")
            elif number == 22 and self.armed and self.mode == 4 and self.height is None:
                self.height = message["param7"]
        elif message.name == "PARAM_REQUEST_READ" and message["param_id"] != "FOO":
            name = message["param_id"]
            value = (
                round(self.number(name))
                if name == "LOG_DISARMED"
                else self.number(name)
            )
            self.tell("PARAM_VALUE", param_id=name, param_value=value)
        elif (
            message.name == "SET_POSITION_TARGET_LOCAL_NED"
            and message["type_mask"] == 2048
        ):
            self.goal = (
                [(message[a], message["v" + a], message["af" + a]) for a in "xyz"],
                message["yaw"],
            )

    def fly(self, state: dict[str, object]) -> None:
        """Update local place, messages and pulse widths for a line of the physics."""
        position, velocity = state["position"], state["velocity"]
        assert state["timestamp"] > self.clock, "a frame was answered twice"
        self.clock = state["timestamp"]
        if state["timestamp"] > READY and self.origin is None:
            self.origin = [position[0] + 2.0, position[1] - 1.0, position[2] - 3.0]
        self.beat += 1
        if self.beat % 400 == 1:
            self.tell(
                "HEARTBEAT",
                type=2,
                autopilot=3,
                base_mode=128 * self.armed,
                custom_mode=self.mode,
                system_status=4,
            )
        if 193 in self.asked and self.beat % 80 == 0:
            self.tell("EKF_STATUS_REPORT", flags=831 if self.origin else 167)
        if self.origin is None:
            return
        place = [a - b for a, b in zip(position, self.origin, strict=True)]
        if 32 in self.asked and self.beat % 16 == 0:
            self.tell("LOCAL_POSITION_NED", x=place[0], y=place[1], z=place[2])
        if not self.armed or self.height is None:
            return
        if self.goal is None:
            start = [-2.0, 1.0, 3.0 - self.height]
            axes, yaw = [(each, 0.0, 0.0) for each in start], None
        else:
            axes, yaw = self.goal
        wish = [
            2.0 * (p - a) + 2.5 * (v - b) + f
            for (p, v, f), a, b in zip(axes, place, velocity, strict=True)
        ]
        w, x, y, z = state["quaternion"]
        heading = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        roll, pitch = (
            math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
            math.asin(2 * (w * y - z * x)),
        )
        north, east, down = wish
        forward = math.cos(heading) * north + math.sin(heading) * east
        right = -math.sin(heading) * north + math.cos(heading) * east
        turn = (
            0.0 if yaw is None else (yaw - heading + math.pi) % (2 * math.pi) - math.pi
        )
        gyro = state["imu"]["gyro"]
        errors = right / 9.81 - roll, -forward / 9.81 - pitch, turn
        commands = [
            self.number(f"ATC_RAT_{name}_P") * (4.5 * error - rate)
            for name, error, rate in zip(
                ("RLL", "PIT", "YAW"), errors, gyro, strict=True
            )
        ]
        thrust = self.number("MOT_THST_HOVER") * (1.0 - down / 9.81)
        for i in range(4):
            part = thrust + 0.5 * (
                commands[0] * ROLL[i] + commands[1] * PITCH[i] + commands[2] * YAW[i]
            )
            self.pulses[i] = round(1000 + 1000 * math.sqrt(min(max(part, 0.0), 1.0)))

    def packet(self, frame: int) -> bytes:
        """Packet of pulse widths."""
        magic = 29569 if WIDE else 18458
        return struct.pack(f"<HHI{len(self.pulses)}H", magic, 800, frame, *self.pulses)

    def break_rules(self) -> None:
        """Commit the fault that was asked for, once."""
        if FAULT == "silence":
            time.sleep(60)
        elif FAULT == "exit":
            print("Fatal: out of luck", flush=True)
            sys.exit(3)
        elif FAULT == "closed":
            self.mavlink.close()
            self.deaf = True
        elif FAULT == "garbage":
            self.physics.send(os.urandom(23))
        elif FAULT == "magic":
            self.physics.send(
                struct.pack("<HHI16H", 4660, 800, self.frame, *self.pulses)
            )
        elif FAULT == "restart":
            self.frame = 0
        elif FAULT == "skip":
            self.frame += 5
        elif FAULT == "pulse":
            self.pulses[2] = 60000
        elif FAULT == "repeat":
            self.physics.send(self.packet(self.frame))

    def run(self) -> None:
        """Send a packet, read the line that answers it, and so on."""
        dropped = False
        while True:
            if self.frame == AT:
                self.break_rules()
            if (
                FAULT == "disarm"
                and self.goal is not None
                and self.armed
                and self.frame > AT
            ):
                self.armed, self.mode = False, 4
                self.tell("STATUSTEXT", severity=2, text="Crash: Disarming")
                self.tell("HEARTBEAT", type=2, autopilot=3, base_mode=0, custom_mode=4)
            for _ in range(4 if FAULT == "impatient" and self.frame == AT else 1):
                self.physics.send(self.packet(self.frame))
            if FAULT == "impatient" and self.frame == AT:
                Path(os.environ["STAND_IN_NOTE"]).write_text(f"{os.getpid()}\nsent")
            line = self.physics.recv(4096)
            if FAULT == "lost" and self.frame == AT and not dropped:
                dropped = True
                for _ in range(2):
                    self.physics.send(self.packet(self.frame))
                line = self.physics.recv(4096)
            if not self.deaf:
                with contextlib.suppress(BlockingIOError):
                    for message in self.parser.feed(self.mavlink.recv(65536)):
                        self.hear(message)
                assert (line[:1], line[-1:]) == (b"\n", b"\n"), line
                self.fly(json.loads(line))
            self.frame += 1


if __name__ == "__main__":
    if note := os.environ.get("STAND_IN_NOTE"):
        Path(note).write_text(f"{os.getpid()}\n" + "\n".join(sys.argv[1:]))
    if FAULT == "stillborn":
        print("Unknown model", flush=True)
        sys.exit(1)
    StandIn().run()
