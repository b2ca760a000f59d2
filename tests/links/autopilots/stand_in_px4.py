"""Stand-in for PX4: a program that speaks its two MAVLink ports, estimates, arms, and
flies by its parameters.

It is written from the facts of the wire alone (forward right down, north east down) and
shares nothing with the link but the MAVLink frames. ``STAND_IN`` in its environment is
a fault and the simulated second from which on it acts: ``die:14``. Run as PX4 is:
``stand_in_px4.py -d -i 0 -w FOLDER ETC``.
"""

from __future__ import annotations

import contextlib
import math
import os
import signal
import socket
import sys
import time
from typing import Any

import numpy as np

from skyarm.links import mavlink

GRAVITY = np.array([0.0, 0.0, 9.81])
EARTH = 6378137.0
ORIGIN = np.array([3.0, -2.0, 1.0])
"""Place of the first satellite reading in the local frame: an origin that is not
ours."""

OFFBOARD, HOLD = 6, 4

ENDS = ("die", "stop", "close", "restart")


def cross(v: Any) -> Any:
    """Matrix of the cross product with a vector."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def turned(R: Any, w: Any) -> Any:
    """Rotation matrix turned by a small rotation vector in its own axes."""
    angle = np.linalg.norm(w)
    if angle < 1e-12:
        return R
    K = cross(w / angle)
    return R @ (np.eye(3) + math.sin(angle) * K + (1.0 - math.cos(angle)) * K @ K)


class Mixer:
    """Rotor signals of torque and thrust set points, by PX4's parameters and the scales
    of its mixer.
    """

    def __init__(self, parameters: dict[str, float]) -> None:
        columns = []
        for i in range(round(parameters["CA_ROTOR_COUNT"])):
            place = np.array([parameters[f"CA_ROTOR{i}_P{c}"] for c in "XYZ"])
            axis = np.array([parameters[f"CA_ROTOR{i}_A{c}"] for c in "XYZ"])
            force = parameters[f"CA_ROTOR{i}_CT"] * axis
            columns.append(
                np.concatenate(
                    [
                        np.cross(place, force) - parameters[f"CA_ROTOR{i}_KM"] * force,
                        force,
                    ]
                )
            )
        self.effect = np.array(columns).T
        mix = np.linalg.pinv(self.effect, rcond=1e-6)
        sizes = [
            np.sqrt((mix[:, k] ** 2).sum() / (np.sum(np.abs(mix[:, k]) > 1e-3) / 2.0))
            for k in (0, 1)
        ]
        mix[:, :2] /= max(sizes)
        mix[:, 2] /= mix[:, 2].max()
        mix[:, 5] /= np.abs(mix[:, 5]).sum() / np.count_nonzero(
            np.abs(mix[:, 5]) > 1e-7
        )
        self.mix, self.curve = mix, parameters["THR_MDL_FAC"]

    def signals(self, torque: Any, thrust: float) -> Any:
        """Signals 0 to 1 of a torque set point (about -1 to 1) and a thrust set point
        (0 to 1).
        """
        shares = np.clip(self.mix[:, :3] @ torque - self.mix[:, 5] * thrust, 0.0, 1.0)
        a, b = self.curve, 1.0 - self.curve
        return (
            (np.sqrt(b * b + 4.0 * a * shares) - b) / (2.0 * a) if a > 1e-6 else shares
        )


class Pilot:
    """Estimate of the state by dead reckoning with satellite corrections, and a cascade
    of controllers.
    """

    def __init__(self, parameters: dict[str, float]) -> None:
        self.p, self.mixer = parameters, Mixer(parameters)
        self.R, self.v, self.x = np.eye(3), np.zeros(3), ORIGIN.copy()
        self.home: tuple[float, float, float] | None = None
        self.last, self.drift, self.bias = 0.0, np.zeros(3), np.zeros(3)

    def sense(self, m: mavlink.Message, armed: bool) -> None:
        """Take an inertial reading."""
        t = m["time_usec"] * 1e-6
        dt, self.last = min(max(t - self.last, 0.0), 0.02), t
        self.w = np.array([m["xgyro"], m["ygyro"], m["zgyro"]])
        if m["fields_updated"] & 0b111000000 and not armed:
            yaw = math.atan2(-m["ymag"], m["xmag"])
            self.R = np.array(
                [
                    [math.cos(yaw), -math.sin(yaw), 0.0],
                    [math.sin(yaw), math.cos(yaw), 0.0],
                    [0, 0, 1.0],
                ]
            )
        if armed:
            self.R = turned(self.R, self.w * dt)
            self.v = (
                self.v
                + (self.R @ np.array([m["xacc"], m["yacc"], m["zacc"]]) + GRAVITY) * dt
            )
            self.x = self.x + self.v * dt
        self.dt = dt

    def fix(self, m: mavlink.Message) -> None:
        """Take a satellite reading."""
        place = (
            math.radians(m["lat"] * 1e-7),
            math.radians(m["lon"] * 1e-7),
            m["alt"] * 1e-3,
        )
        self.home = self.home or place
        north = (place[0] - self.home[0]) * EARTH
        east = (place[1] - self.home[1]) * EARTH * math.cos(place[0])
        here = ORIGIN + np.array([north, east, self.home[2] - place[2]])
        self.x = self.x + 0.2 * (here - self.x)
        self.v = self.v + 0.1 * (np.array([m["vn"], m["ve"], m["vd"]]) / 100.0 - self.v)

    def fly(self, goal: mavlink.Message | None) -> Any:
        """Rotor signals that follow a set point."""
        p = self.p
        if goal is None:
            return self.mixer.signals(np.zeros(3), 0.1)
        error = np.array([goal["x"], goal["y"], goal["z"]]) - self.x
        self.drift = np.clip(self.drift + 0.3 * error * self.dt, -2.0, 2.0)
        wanted = np.array([goal["vx"], goal["vy"], goal["vz"]]) + np.clip(
            0.95 * error, -1.5, 1.5
        )
        force = (
            np.array([goal["afx"], goal["afy"], goal["afz"]])
            + 1.8 * (wanted - self.v)
            + self.drift
            - GRAVITY
        )
        down = -force / np.linalg.norm(force)
        right = np.cross(down, [math.cos(goal["yaw"]), math.sin(goal["yaw"]), 0.0])
        right /= np.linalg.norm(right)
        aim = np.array([np.cross(right, down), right, down]).T
        skew = aim.T @ self.R - self.R.T @ aim
        off = -0.5 * np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
        spin = np.array([p["MC_ROLL_P"], p["MC_PITCH_P"], 1.5]) * off - self.w
        self.bias = np.clip(self.bias + spin * self.dt, -0.5, 0.5)
        torque = np.array(
            [
                p[f"MC_{a}RATE_P"] * s + p[f"MC_{a}RATE_I"] * b
                for a, s, b in zip(
                    ("ROLL", "PITCH", "YAW"), spin, self.bias, strict=True
                )
            ]
        )
        lift = p["MPC_THR_HOVER"] * float(-force @ self.R[:, 2]) / 9.81
        return self.mixer.signals(torque, min(max(lift, 0.05), 1.0))


class StandIn:
    """Ports and states of the stand-in."""

    def __init__(self, instance: int, fault: str) -> None:
        self.fault, _, begin = fault.partition(":")
        self.begin, self.number = float(begin or 0.0), instance
        self.armed, self.mode, self.sub_mode, self.steps = False, HOLD, 0, 0
        self.goal: mavlink.Message | None = None
        prefix = "PX4_PARAM_"
        self.pilot = Pilot(
            {
                k[len(prefix) :]: float(v)
                for k, v in os.environ.items()
                if k.startswith(prefix)
            }
        )
        self.udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.udp.bind(("127.0.0.1", 14580 + instance))
        self.udp.setblocking(False)
        self.parser, self.onboard, self.sequence = (
            mavlink.Parser(),
            mavlink.Parser(datagrams=True),
            [0, 0],
        )
        self.tcp = self.connect()

    def connect(self) -> socket.socket:
        """Connect to the simulator, as PX4 does, again and again."""
        while True:
            try:
                return socket.create_connection(("127.0.0.1", 4560 + self.number))
            except ConnectionError:
                time.sleep(0.01)

    def frame(self, port: int, name: str, **fields: Any) -> bytes:
        self.sequence[port] += 1
        return mavlink.pack(
            name,
            sequence=self.sequence[port] & 255,
            system=self.number + 1,
            component=1,
            **fields,
        )

    def tell(self, name: str, **fields: Any) -> None:
        """Send a message over the onboard port."""
        self.udp.sendto(
            self.frame(1, name, **fields), ("127.0.0.1", 14540 + self.number)
        )

    def run(self) -> None:
        """Answer until the simulator closes the connection."""
        self.tcp.sendall(
            self.frame(0, "HEARTBEAT", autopilot=12)
            + self.frame(0, "COMMAND_LONG", command=511)
        )
        while data := self.tcp.recv(65536):
            for message in self.parser.feed(data):
                if message.name == "HIL_GPS":
                    self.pilot.fix(message)
                elif message.name == "HIL_SENSOR":
                    self.step(message)
        print("connection closed by the simulator, exiting now", flush=True)

    def step(self, sensed: mavlink.Message) -> None:
        """Answer a sensor message."""
        t = sensed["time_usec"] * 1e-6
        self.steps += 1
        if self.steps < 5:  # the start script has not ended
            return
        self.listen()
        self.pilot.sense(sensed, self.armed)
        acts = self.fault if t >= self.begin else ""
        if acts == "disarm":
            self.armed = False
        if acts == "leave":
            self.mode = HOLD
        signals = (
            self.pilot.fly(self.goal)
            if self.armed
            else np.zeros(len(self.pilot.mixer.mix))
        )
        if self.steps % 250 == 6:
            busy = 128 * self.armed
            self.tell(
                "HEARTBEAT",
                type=2,
                autopilot=12,
                base_mode=busy,
                custom_mode=self.mode << 16 | self.sub_mode << 24,
                system_status=4,
            )
            self.tell("ESTIMATOR_STATUS", flags=0b111111)
        if self.steps % 8 == 0:
            x, v = self.pilot.x, self.pilot.v
            self.tell(
                "LOCAL_POSITION_NED", x=x[0], y=x[1], z=x[2], vx=v[0], vy=v[1], vz=v[2]
            )
        self.answer(sensed["time_usec"], [*signals, *[0.0] * (16 - len(signals))], acts)

    def send_parameter(self, name: str) -> None:
        """Send a parameter; a whole-numbered one has its bits in place of a float's,
        and is cut to 32 bits.
        """
        value, kind = np.float32(self.pilot.p[name]), 9
        if name.endswith("_COUNT"):
            value, kind = np.int32(value).view(np.float32), 6
        self.tell(
            "PARAM_VALUE", param_id=name, param_value=float(value), param_type=kind
        )

    def answer(self, stamp: int, controls: list[float], acts: str) -> None:
        """Answer with rotor signals, or act out a fault."""
        if acts in ENDS:
            self.end(acts)
        if acts in ("garbage", "text"):
            line = b"HTTP/1.1 400 Bad Request\r\n"
            self.tcp.sendall(
                np.random.default_rng(1).bytes(9000)
                if acts == "garbage"
                else line * 400
            )
        if acts in ("garbage", "text", "silent") or (
            acts == "seldom" and stamp % 12_000 >= 4_000
        ):
            return
        if acts == "twice":
            with contextlib.suppress(ConnectionRefusedError):
                socket.create_connection(("127.0.0.1", 4560 + self.number)).sendall(
                    b"\xfd" * 300
                )
                os._exit(4)
        controls[1] = {"nan": math.nan, "range": 1.5}.get(acts, controls[1])
        stamp += {"future": 1_000_000, "late": -4000}.get(acts, 0)
        flags = 0 if acts == "unlocked" else 1
        mode = 1 | 128 * self.armed
        self.tcp.sendall(
            self.frame(
                0,
                "HIL_ACTUATOR_CONTROLS",
                time_usec=stamp,
                flags=flags,
                controls=controls,
                mode=mode,
            )
        )

    def end(self, acts: str) -> None:
        """End in one of the ways in which a program may."""
        if acts == "die":
            print("\x1b[31mthe stand-in dies\x1b[0m", flush=True)
            os._exit(3)
        if acts == "stop":
            os.kill(os.getpid(), signal.SIGSTOP)
            return
        self.tcp.close()
        if acts == "close":
            time.sleep(1e3)
        self.udp.close()
        os.execv(sys.executable, [sys.executable, *sys.argv])

    def listen(self) -> None:
        """Take set points and commands."""
        while True:
            try:
                data = self.udp.recv(65536)
            except (BlockingIOError, ConnectionError):
                return
            for m in self.onboard.feed(data):
                if m.fields.get("target_system", self.number + 1) not in (
                    0,
                    self.number + 1,
                ):
                    continue
                if m.name == "PARAM_REQUEST_READ" and self.fault != "mute":
                    self.send_parameter(m["param_id"])
                elif m.name == "SET_POSITION_TARGET_LOCAL_NED":
                    self.goal = m
                elif (
                    m.name == "COMMAND_LONG"
                    and m["command"] == 176
                    and self.goal is not None
                ):
                    self.mode, self.sub_mode = round(m["param2"]), round(m["param3"])
                elif (
                    m.name == "COMMAND_LONG"
                    and m["command"] == 400
                    and self.mode == OFFBOARD
                ):
                    if self.fault == "refuse":
                        self.tell(
                            "STATUSTEXT",
                            severity=3,
                            text="Arming denied: the stand-in will not",
                        )
                    else:
                        self.armed = True


def main() -> None:
    """Start as PX4 does."""
    fault = os.environ.get("STAND_IN", "")
    if fault == "boot":
        print("INFO  [init] the stand-in ends at once", flush=True)
        sys.exit(1)
    if fault == "deaf":
        time.sleep(1e3)
    if fault == "unknown":
        print("ERROR [param] Parameter NO_SUCH not found.", flush=True)
    StandIn(int(sys.argv[sys.argv.index("-i") + 1]), fault).run()


if __name__ == "__main__":
    main()
