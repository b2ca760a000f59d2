"""Program that plays Betaflight: its console over TCP, then angle mode over UDP, and
the ways in which it can fail.

It runs as a process of its own. The first start, in an empty folder, takes lines on the
console until `save`, which ends it; the second flies by them. The first line of the
file `way` beside it says how it fails, if it does.
"""

import math
import os
import pathlib
import socket
import struct
import sys
import time

SAVED = pathlib.Path("eeprom.bin")
GARBAGE = (b"", b"x", bytes(67), bytes(69), bytes(2000))


def console(answer_lines):
    with socket.socket() as listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(("127.0.0.1", 5761))
        listener.listen(1)
        return answer_lines(listener.accept()[0])


def set_up(peer, way):
    if peer.recv(64) != b"#":
        sys.exit("the console is asked for by one character alone")
    peer.sendall(b"\r\nEntering CLI Mode\r\n\r\n# ")
    text = b""
    while True:
        text += peer.recv(4096)
        while b"\n" in text:
            line, text = text.split(b"\n", 1)
            if line == b"save":
                sys.exit("disk full" if way == "unsaved" else 0)
            with SAVED.open("ab") as file:
                file.write(line + b"\n")
            wrong = (
                b"###ERROR IN set: INVALID NAME: nonsense###\r\n"
                if b"nonsense" in line
                else b""
            )
            words = line.split()
            if not wrong and words[0] == b"set":  # a fraction is cut off
                wrong = words[1] + b" set to " + words[3].partition(b".")[0] + b"\r\n"
            peer.sendall(line + b"\r\n" + wrong + b"\r\n# ")


def greet(peer):
    if peer.recv(64) == b"$M<\x00\x01\x01":
        peer.sendall(b"$M>\x03\x01\x00\x01\x2f\x2c")


def fly(way):
    rows = [line.split() for line in SAVED.read_text().splitlines()]
    mixer = [
        [float(share) for share in row[2:]]
        for row in rows
        if row[0] == "mmix" and row[1] != "reset"
    ]
    numbers = {row[1]: row[3] for row in rows if row[0] == "set"}
    limit, end = (
        math.radians(float(numbers["angle_limit"])),
        math.radians(10.0 * float(numbers["yaw_rc_rate"])),
    )
    gains = [
        0.032029e-3 * float(numbers[f"p_{axis}"]) * 180.0 / math.pi
        for axis in ("roll", "pitch", "yaw")
    ]
    idle, curve = (
        1e-4 * float(numbers["motor_idle"]),
        1e-2 * float(numbers["thrust_linear"]),
    )
    state, radio, motors = (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(3)
    )
    state.bind(("127.0.0.1", 9003))
    radio.bind(("127.0.0.1", 9004))
    console(greet)
    if way == "faints":
        sys.exit("out of breath")
    channels, armed, count = None, False, 0
    state.settimeout(20.0)
    radio.setblocking(False)
    while True:
        _, p, q, r, _, _, _, w, x, y, z, *_ = struct.unpack("<18d", state.recv(4096))
        try:
            while True:
                channels = struct.unpack("<d16H", radio.recv(4096))[1:]
        except BlockingIOError:
            pass
        count += 1
        if channels is None:
            continue
        armed = channels[4] > 1700
        # on the wire pitch turns the nose up and yaw to the right; in the firmware down
        # and to the left
        q, r, y, z = -q, -r, -y, -z
        roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
        pitch = math.asin(2 * (w * y - z * x))
        sticks = [(channels[i] - 1500) / 500 for i in (0, 1, 3)]
        rates = (
            10 * (limit * sticks[0] - roll),
            10 * (limit * sticks[1] - pitch),
            -end * sticks[2],
        )
        push = [
            gain * (wanted - rate)
            for gain, wanted, rate in zip(gains, rates, (p, q, r), strict=True)
        ]
        throttle = (channels[2] - 1050) / 950
        throttle /= 1 + (curve - 0.5 * curve**2) * (1 - throttle) ** 2
        signals = []
        for share in mixer:
            mix = (
                share[0] * throttle
                + share[1] * push[0]
                + share[2] * push[1]
                - share[3] * push[2]
            )
            mix = min(max(mix * (1 + curve * (1 - mix) ** 2), 0.0), 1.0)
            signals.append(1000 * (1 + idle + (1 - idle) * mix) if armed else 1000.0)
        if count > 1400 and way == "disarms":
            signals = [1000.0] * len(mixer)
        if count > 700:
            if way == "dies":
                print("out of luck", flush=True)
                os._exit(3)
            if way == "silent":
                continue
            if way == "numbers":
                signals[0] = math.nan
            if way == "garbage":
                motors.sendto(GARBAGE[count % len(GARBAGE)], ("127.0.0.1", 9001))
                continue
        number = len(mixer) + 1 if way == "motors" else len(mixer)
        packet = struct.pack("<H2x16f", number, *signals, *(0.0,) * (16 - len(signals)))
        motors.sendto(packet, ("127.0.0.1", 9001))


def main():
    way = pathlib.Path(__file__).with_name("way")
    way = way.read_text() if way.exists() else ""
    if way == "ends":
        sys.exit("no such luck")
    starts = pathlib.Path(__file__).with_name("starts")
    starts.write_text(starts.read_text() + "x" if starts.exists() else "x")
    # of the console first, then of the flight
    if way == "drowsy" and len(starts.read_text()) in (1, 3):
        console(lambda peer: time.sleep(20.0))
    if way == "deaf":  # longer than its peer waits
        time.sleep(20.0)
    if not SAVED.exists():
        console(lambda peer: set_up(peer, way))
    else:
        fly(way)


if __name__ == "__main__":
    main()
