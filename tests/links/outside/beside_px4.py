"""A law in one process, simulator and PX4 in another, as users start them: how well it
flies, and how late it is.

    python tests/links/outside/beside_px4.py [LAW ...] [--instance N] [--domain N]

For each law two lines. The first: delay of a set point, from PX4's sensor message of
the estimate's time to the set point's datagram, by one monotonic clock; the share of it
behind the estimate's arrival; estimates without an answer. The second: the tip's error
on a slow circle, and that of the simulator's own flight of the same law with that
delay, with perfect state and with the errors of PX4's estimate replayed. Needs
SKYARM_PX4, the path of PX4's program. The satellite receiver is as good as a camera
system (1 mm, 50 Hz), so that the error is the law's.

With a domain the law commands motors over uXRCE-DDS, at the 100 Hz of PX4's client: PX4
must be built with it, and an agent must run (MicroXRCEAgent udp4 -p 8888).

PX4's local frame has an origin of its own: truth and estimate are compared without
their mean difference.
"""

from __future__ import annotations

import argparse
import dataclasses
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.algebra import Quaternion, Vec3
from skyarm.links.autopilots.px4_ports import JOINT_PORT, ONBOARD_PORT
from skyarm.links.outside.dds_link import DdsLink
from skyarm.links.outside.offboard_link import OffboardLink
from skyarm.links.outside.outside_law import LoopSettings, OutsideLaw
from skyarm.links.outside.rate_commands import IdealRateLoop
from skyarm.log.flight_log import Log
from skyarm.log.formats import load_log
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.session import open_session

SCENARIO = """
schema = 1
name = "{name}"
duration = {duration}
[rates]
physics = 1000
control = {rate}
reference = 50
[plant]
vehicle = "hummingbird_arm2_rotors"
[model]
vehicle = "hummingbird_arm2"
[controller]
{controller}
[sensors.gnss]
kind = "gnss"
frequency = 50
position = {{ sigma = 0.001 }}
velocity = {{ sigma = 0.005 }}
[reference.base]
kind = "circle"
radius = 0.3
frequency_hz = 0.1
center = [0.0, 0.0, 1.0]
start = 0.5
[[reference.joints]]
kind = "sine"
amplitude = 0.3
frequency_hz = 0.5
[[reference.joints]]
kind = "sine"
amplitude = 0.2
frequency_hz = 0.5
"""


AUTOPILOT = """autopilot = "px4"
outside = true
instance = {instance}
parameters = {{ EKF2_HGT_REF = 1, EKF2_BARO_CTRL = 0{more} }}"""
"""Table of the simulator's side: height by the satellite receiver."""

FOR_DDS = ", UXRCE_DDS_SYNCT = 0, UXRCE_DDS_PTCFG = 1, EKF2_PREDICT_US = 4000"
"""Parameters: times of PX4's own clock, no other machine, estimates at the inertial
unit's rate."""


def simulate(folder: Path) -> None:
    """Fly the simulator's side in real time until a file ``stop`` is there; write path,
    times and status.
    """
    session = open_session(load_scenario(str(folder / "sim.toml")))
    link, rows, sent, stop = session._link, [], [], folder / "stop"
    exchange = link.exchange

    def noted(now, goal):
        sent.append((now.time, time.monotonic()))
        return exchange(now, goal)

    link.exchange = noted
    while session.running and not (session.tick % 50 == 0 and stop.exists()):
        session.step()
        if session.tick % 5 == 0:
            rows.append((time.time(), *(float(c) for c in session.state.position)))
    ended = session.ended
    log = session.log
    session.close()
    log.save_npz(folder / "sim.npz")
    np.save(folder / "path.npy", np.array(rows))
    np.save(folder / "sent.npy", np.array(sent))
    (folder / "status").write_text(
        "hovers" if ended is None else f"{ended.status}: {ended.cause}"
    )


def note_answers(arguments: list[str]) -> None:
    """Run ``skyarm``, and write the times of the estimates that it answers: PX4's, of
    arrival, of answer.
    """
    from skyarm.cli.main import main

    rows = []

    def note(kind):
        send = kind.send

        def noted(link, command):
            send(link, command)
            rows.append((link.state.time, link.heard, time.monotonic()))

        kind.send = noted

    for kind in (OffboardLink, DdsLink):
        note(kind)
    sys.argv = ["skyarm", *arguments]
    try:
        main()
    finally:
        np.save("answers.npy", np.array(rows))


@contextmanager
def simulator(
    folder: Path, instance: int, seconds: float, domain: int | None = None
) -> Iterator[subprocess.Popen[bytes]]:
    """Simulator and PX4 in a process of their own, for at most so long; they are ended
    at the end of the block.
    """
    table = AUTOPILOT.format(instance=instance, more="" if domain is None else FOR_DDS)
    (folder / "sim.toml").write_text(
        SCENARIO.format(name="sim", duration=seconds, controller=table, rate=250)
    )
    more = {} if domain is None else {"ROS_DOMAIN_ID": str(domain)}
    process = subprocess.Popen(
        [sys.executable, __file__, "--simulate", str(folder)],
        env={**os.environ, **more},
    )
    try:
        wait_for_port(ONBOARD_PORT + instance, process)
        yield process
    finally:
        (folder / "stop").touch()
        try:
            process.wait(90.0)
        finally:
            process.kill()


def start_law(
    folder: Path,
    instance: int,
    law: str,
    seconds: float,
    *,
    noted: bool = False,
    domain: int | None = None,
) -> subprocess.Popen[str]:
    """Start 'skyarm fly', whose log will be in the folder ``out``; ``noted``: by
    :func:`note_answers`.
    """
    rate = 250 if domain is None else 100
    (folder / "law.toml").write_text(
        SCENARIO.format(name="law", duration=seconds, controller=law, rate=rate)
    )
    link = f"mavlink://127.0.0.1:{ONBOARD_PORT + instance}"
    if domain is not None:
        link = f"dds://{domain}" + (f"/px4_{instance}" if instance else "")
    program = (__file__, "--answer") if noted else ("-m", "skyarm")
    return subprocess.Popen(
        [
            sys.executable,
            *program,
            "fly",
            "law.toml",
            "--patience",
            "60",
            "--out",
            "out",
            "--link",
            link,
            "--joints",
            f"udp://127.0.0.1:{JOINT_PORT + instance}",
        ],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def wait_for_port(
    port: int, simulator: subprocess.Popen[bytes], seconds: float = 60.0
) -> None:
    """Wait until the simulator has taken a port; a law that is at PX4's onboard port
    first would keep it.
    """
    until = time.monotonic() + seconds
    while simulator.poll() is None and time.monotonic() < until:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                return
        time.sleep(0.02)
    raise RuntimeError("the simulator did not start")


def command_of(pid: int) -> str:
    """Command line of a process that runs; empty for one that has ended."""
    try:
        return (
            Path(f"/proc/{pid}/cmdline")
            .read_bytes()
            .replace(b"\0", b" ")
            .decode("utf-8", "replace")
            .strip()
        )
    except OSError:
        return ""


def descendants(pid: int) -> list[int]:
    """Numbers of the processes that a process has started, and theirs."""
    children = Path(f"/proc/{pid}/task/{pid}/children")
    found = []
    for child in children.read_text().split() if children.exists() else ():
        found += [int(child), *descendants(int(child))]
    return found


def fly_beside(
    law: str, instance: int = 0, seconds: float = 24.0, domain: int | None = None
) -> dict[str, float | str]:
    """Errors of a law that flies a circle outside, mm after 4 s, and its delays, ms.

    Args:
        law: lines of the table ``[controller]``.
        instance: of PX4.
        seconds: of flight.
        domain: of DDS; None for rates over MAVLink.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with simulator(folder, instance, 4.0 * seconds, domain):
            process = start_law(
                folder, instance, law, seconds, noted=True, domain=domain
            )
            said = process.communicate(timeout=10.0 * seconds)[0]
        if not (folder / "out" / "law.npz").exists():
            raise RuntimeError(said)
        return measured(folder)


def measured(folder: Path) -> dict[str, float | str]:
    """Numbers of a flight whose files are in a folder."""
    flown, truth = load_log(folder / "out" / "law.npz"), load_log(folder / "sim.npz")
    own = load_scenario(str(folder / "law.toml"))
    found = {
        "law": flown.info["controller"],
        "status": flown.status,
        **delays(folder, flown),
    }
    estimate, there = Motion.of(flown), Motion.of(truth).moved(flown, truth)
    errors = estimate.minus(there)
    late = flown.time > 4.0
    shift = (flown.position - there.position)[late].mean(axis=0)
    found["truth_mm"] = mean_error((there.tool + shift - flown.tool_reference)[late])
    found["estimate_mm"] = mean_error((flown.tool - flown.tool_reference)[late])
    found["estimate_error_mm"] = mean_error(
        (flown.position - there.position - shift)[late]
    )
    delay = round(found["delay_p50_ms"] * 1e-3 * own.rates.control) / own.rates.control
    delayed = skyarm.run(
        dataclasses.replace(own, delays=dataclasses.replace(own.delays, command=delay))
    )
    for words, log in (
        ("own_mm", delayed),
        ("own_estimate_mm", fly_with_errors(own, errors, late)),
    ):
        part = log.time > 4.0
        found[words] = mean_error((log.tool - log.tool_reference)[part])
    return found


def delays(folder: Path, flown: Log) -> dict[str, float]:
    """Delays of the set points, ms, and the share of the estimates that got none."""
    sent, answers = np.load(folder / "sent.npy"), np.load(folder / "answers.npy")
    answers = answers[answers[:, 0] >= flown.info["outside"]["start_s"]]
    begun = np.interp(answers[:, 0], *sent.T)
    found = {}
    for name, times in (
        ("delay", answers[:, 2] - begun),
        ("behind_arrival", answers[:, 2] - answers[:, 1]),
    ):
        found |= {
            f"{name}_p{share}_ms": round(1e3 * float(np.percentile(times, share)), 2)
            for share in (50, 99)
        }
    outside = flown.info["outside"]
    return found | {
        "lost": outside["missed"],
        "of": outside["missed"] + outside["periods"],
    }


@dataclasses.dataclass(frozen=True)
class Motion:
    """Positions (m) of base and tip, velocities (m/s), attitudes, body rates (rad/s),
    in the world of the law.
    """

    position: np.ndarray
    tool: np.ndarray
    velocity: np.ndarray
    attitude: Rotation
    rate: np.ndarray

    @staticmethod
    def of(log: Log) -> Motion:
        """Motion as a log has it."""
        attitude = Rotation.from_quat(log.quaternion, scalar_first=True)
        return Motion(log.position, log.tool, log.velocity, attitude, log.rate)

    def moved(self, flown: Log, truth: Log) -> Motion:
        """The simulator's motion at the times of the law's log, in the law's world."""
        outside = flown.info["outside"]
        times = flown.time + outside["start_s"] - truth.info["autopilot"]["prepared_s"]
        turn = Rotation.from_euler("z", outside["turn"])

        def at(column: np.ndarray) -> np.ndarray:
            return np.stack(
                [np.interp(times, truth.time, each) for each in column.T], axis=1
            )

        begun = at(self.position)[0]
        place, tool = (
            turn.apply(at(each) - begun) + outside["start"]
            for each in (self.position, self.tool)
        )
        attitude = turn * Rotation.from_quat(at(self.attitude.as_quat(canonical=True)))
        return Motion(
            place, tool, turn.apply(at(self.velocity)), attitude, at(self.rate)
        )

    def minus(self, other: Motion) -> Motion:
        """Difference; attitudes by a rotation of the world."""
        parts = (
            getattr(self, name) - getattr(other, name)
            for name in ("position", "tool", "velocity")
        )
        return Motion(
            *parts, self.attitude * other.attitude.inv(), self.rate - other.rate
        )


def fly_with_errors(own: Scenario, errors: Motion, late: np.ndarray) -> Log:
    """The simulator's own flight of a law that measures the true state plus the errors
    of an estimate.
    """
    session = open_session(own)
    period = 1.0 / own.rates.control
    settings = LoopSettings(
        period=period,
        rate_loop=IdealRateLoop(bandwidth=(18.0, 18.0, 6.0)),
        full_thrust=1e3,
    )
    law = OutsideLaw(own.controller, settings, session.reference)
    shift = errors.position[late].mean(axis=0)
    for k in range(len(late)):
        m = session.measurement
        turned = errors.attitude[k] * Rotation.from_quat(
            tuple(m.quaternion), scalar_first=True
        )
        seen = dataclasses.replace(
            m,
            position=Vec3(*(m.position + Vec3(*(errors.position[k] - shift)))),
            velocity=Vec3(*(m.velocity + Vec3(*errors.velocity[k]))),
            rate=Vec3(*(m.rate + Vec3(*errors.rate[k]))),
            quaternion=Quaternion(*turned.as_quat(scalar_first=True)),
        )
        if not session.step(law.step(seen, session.reference).law):
            break
    return session.log


def mean_error(error: np.ndarray) -> float:
    """Mean length, mm."""
    return round(1e3 * float(np.linalg.norm(error, axis=1).mean()), 1)


LINES = """{law}: {status}; set points {delay_p50_ms} ms behind PX4's time \
(99 %: {delay_p99_ms} ms), of it \
{behind_arrival_p50_ms} ms behind the estimate's arrival \
(99 %: {behind_arrival_p99_ms} ms), lost {lost} of {of}
tip {truth_mm} mm off (estimated: {estimate_mm} mm); own run with that delay {own_mm} \
mm, with the errors of PX4's \
estimate ({estimate_error_mm} mm) {own_estimate_mm} mm"""


if __name__ == "__main__":
    if sys.argv[1:2] == ["--answer"]:
        note_answers(sys.argv[2:])
        sys.exit()
    words = argparse.ArgumentParser()
    words.add_argument(
        "laws", nargs="*", default=['preset = "paper_ct"', 'law = "centroidal"']
    )
    words.add_argument("--instance", type=int, default=0)
    words.add_argument("--domain", type=int)
    words.add_argument("--simulate", type=Path)
    given = words.parse_args()
    if given.simulate:
        simulate(given.simulate)
    else:
        for each in given.laws:
            print(
                LINES.format(**fly_beside(each, given.instance, domain=given.domain)),
                flush=True,
            )
