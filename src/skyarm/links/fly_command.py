"""Command ``skyarm fly``: fly a vehicle through its autopilot, by a law that runs
here.
"""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import Annotated

import typer

from skyarm.cli.arguments import (
    Duration,
    Law,
    Out,
    ScenarioOrLog,
    one_law,
    require_not_another,
)
from skyarm.cli.lines import NOT_COMPLETED, say_suspicious
from skyarm.cli.output import give, say_cause, tell
from skyarm.cli.run_command import save_logs
from skyarm.links.outside.autopilot_link import open_link
from skyarm.links.outside.joint_links import open_joints
from skyarm.links.outside.offboard import (
    OffboardFlight,
    OffboardSettings,
    require_outside,
)
from skyarm.log.flight_summary import facts, headline, summary
from skyarm.records.files import require_replaceable, require_writable, taken_back
from skyarm.scenario.scenario_file import load_scenario
from skyarm.view.pages import Facts


def fly(
    scenario: ScenarioOrLog,
    link: Annotated[str, typer.Option()],
    joints: str | None = None,
    laws: Law = None,
    rate_bandwidth: str | None = None,
    world: str = "here",
    leash: float = 1.5,
    patience: float = 60.0,
    duration: Duration = None,
    out: Out = "out/fly",
) -> None:
    """Fly through an autopilot, by a law that runs here.

    The vehicle must be armed and hover; at the end, and when anything is silent, it is
    asked to hold its place. Exit code 3 if it ended early.

    Options:
        link URL: the autopilot: mavlink://HOST:PORT waits; mavlink-out://HOST:PORT
            calls; dds://DOMAIN
        joints URL: joints: udp://HOST:PORT, dynamixel:DEVICE?ids=1,2 or FILE.py:make
        rate_bandwidth X,Y,Z: bandwidth of the rate loop of an autopilot other than PX4,
            rad/s
        world: here (begin at the vehicle), or local
        leash: distance from the reference at which the flight ends, m
        patience: longest wait for a vehicle that hovers, s
    """
    require_not_another(scenario, "scenario")
    planned = load_scenario(scenario, controller=one_law(laws), duration=duration)
    # what cannot be flown or written is refused before a vehicle is waited for
    require_outside(planned)
    if world not in ("here", "local"):
        raise ValueError(f"--world = {world!r}: must be here or local")
    settings = OffboardSettings(
        rate_bandwidth=None if rate_bandwidth is None else _three(rate_bandwidth),
        here=world == "here",
        leash=leash,
        patience=patience,
    )
    folder = Path(out)
    files = [folder / f"{planned.name}{suffix}" for suffix in (".npz", ".csv")]
    new = not folder.exists()
    with taken_back(folder):
        require_writable(out)
        require_replaceable(*files, renames=True)
        say_suspicious(planned)
        vehicle = planned.agent.model.vehicle
        with (
            closing(open_joints(joints, vehicle)) as arm,
            closing(open_link(link, patience)) as autopilot,
        ):
            flight = OffboardFlight(planned, autopilot, arm, settings, tell)
            log = flight.run()
        written, earlier = save_logs(log, files)
    values = facts(log) | {"outside": log.info["outside"]}
    words = f"log: {', '.join(map(str, written))}{' (new folder)' if new else ''}"
    tell(*summary(log, values), *_times(log.info["outside"]), words)
    give(values, logs=written, kept=earlier)
    if flight.interrupted is not None:
        raise flight.interrupted
    if log.status != "completed":
        say_cause(headline(log, values))
        raise typer.Exit(NOT_COMPLETED)


def _times(said: Facts) -> list[str]:
    """Lines of text on computing times, round trips and missed periods."""
    words = {
        "computing": "from an estimate's arrival to its set point",
        "round_trip": "to the autopilot and back",
    }
    lines = [
        f"{text}: median {said[name]['p50_ms']:.2f} ms, 99 %"
        f" {said[name]['p99_ms']:.2f} ms"
        for name, text in words.items()
        if said[name]["count"]
    ]
    return [
        *lines,
        (
            f"{said['periods']} periods, {said['missed']} missed, {said['lost_frames']}"
            " frames lost"
        ),
    ]


def _three(text: str) -> tuple[float, float, float]:
    """Parse three positive numbers separated by commas.

    Raises:
        ValueError: anything else.
    """
    try:
        x, y, z = map(float, text.split(","))
    except ValueError:
        x = y = z = 0.0
    # 1000 rad/s, chosen, is beyond any rate loop
    if not all(0.0 < each < 1e3 for each in (x, y, z)):
        raise ValueError(
            f"--rate-bandwidth = {text!r}: must be three numbers of rad/s, above 0:"
            " 18,18,6"
        )
    return x, y, z
