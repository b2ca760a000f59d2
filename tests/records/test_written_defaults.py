"""A default that is written out changes nothing: every table of the pages, and flights
to the bit.

The defaults are those of the pages' columns, as texts. A scenario that is read with
them must be the one that is read without them, to the type of each number: flights
follow from records.
"""

from __future__ import annotations

import copy
import dataclasses
import json
import re
import tomllib
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.log.metrics.score import score
from skyarm.planning.task import Goal, PlannedContact, Start, TaskLimits
from skyarm.records.files import Fields
from skyarm.records.plain import plain
from skyarm.records.read_table import record_from
from skyarm.records.registry.shipped import SHIPPED
from skyarm.scenario.numbers import with_numbers
from skyarm.vehicle.vehicle_tables import vehicle_from
from support.pages import DOCS, cells_of
from support.teams import TEAMS
from website.generated_blocks import made

Tables = dict[str, Any]

WORDS = "<!-- generated: words"
RECORD = "<!-- generated: record skyarm"
OF_SENSORS = "<!-- generated: sensors -->"
MADE = ""
"""In place of a page: the head is that of a block, made afresh."""

SENSORS: Tables = {
    "imu": {"kind": "imu"},
    "encoders": {"kind": "encoders"},
    "pose": {"kind": "pose"},
    "wrist": {"kind": "force_torque"},
    "switch": {"kind": "tactile_switch"},
    "compass": {"kind": "magnetometer"},
    "barometer": {"kind": "barometer"},
}
BOX: Tables = {
    "name": "box",
    "size": [0.1, 0.1, 0.1],
    "mass": 0.1,
    "position": [1.0, 0.0, 0.05],
}
GUST: Tables = {"start": 0.1, "duration": 0.1}
DOOR: Tables = {
    "name": "door",
    "kind": "door",
    "size": [0.5, 1.0, 0.05],
    "mass": 5.0,
    "position": [5.0, 0.0, 0.0],
}
HOVER: Tables = {"kind": "hover", "position": [0.0, 0.0, 2.0]}
SERVO: Tables = {"inertia": 1e-3, "stiffness": 2.0}


def tables(**own: Any) -> Tables:
    """Tables of a small scenario, with others of its own."""
    return copy.deepcopy(
        {
            "name": "written",
            "duration": 6.0,
            "plant": {"vehicle": "hummingbird_arm2_rotors"},
            "controller": {"law": "decoupled_pd"},
            "environment": {"ground": False},
            "reference": {"base": HOVER},
        }
        | own
    )


def world(**more: Any) -> Tables:
    return tables(world={"surfaces": [{"name": "floor"}], **more})


def flown_by(autopilot: str) -> Tables:
    return tables(controller={"autopilot": autopilot}, plant={"vehicle": "hummingbird"})


def moved(**base: Any) -> Tables:
    return tables(reference={"base": base})


def governed() -> Tables:
    return tables(reference={"base": HOVER, "governor": {}})


def led() -> Tables:
    path = {"kind": "hover", "position": [0.0, 0.0, 1.8]}
    return tables(
        controller={"law": "centroidal", "mode": "tip"},
        reference={"tip": {"path": path}},
    )


def safe(**own: Any) -> Tables:
    return tables(controller={"law": "decoupled_pd", "safety": {"climb": 4.0}})


def team(law: str) -> Tables:
    """Tables of a plate that three vehicles carry, under a law of a team."""
    document = tomllib.loads((TEAMS / "plate.toml").read_text("utf-8"))
    return document | {"team": {"law": law, "object": "plate"}}


def led_on(vehicle: str, **options: Any) -> Tables:
    """Tables of a law that keeps the tip of a vehicle, by whose arm it computes
    defaults.
    """
    law = {"law": "centroidal", "mode": "tip", **options}
    return tables(
        controller=law,
        plant={"vehicle": vehicle},
        reference={"base": HOVER, "load": 0.0},
    )


def standing() -> Tables:
    """Tables of a vehicle that stands on a floor with its skids."""
    points = [
        {"name": f"skid{x}{y}", "body": "base", "position": [0.1 * x, 0.1 * y, -0.3]}
        for x in (-1, 1)
        for y in (-1, 1)
    ]
    return world(points=points) | {
        "initial": {"standing": True},
        "reference": {"base": HOVER, "joints": [1.5, 1.5]},
    }


SAFETY = f"{WORDS} controller.safety -"
PAGES: list[tuple[str, str, str, Tables]] = [
    ("scenario_files", f"{WORDS} top", "", tables()),
    ("scenario_files", f"{WORDS} rates", "rates", tables()),
    ("scenario_plant", f"{WORDS} plant", "plant", tables()),
    (
        "scenario_plant",
        f"{WORDS} model",
        "model",
        tables(model={"vehicle": "hummingbird_arm2"}),
    ),
    ("scenario_reference", f"{WORDS} controller -->", "controller", tables()),
    (
        "scenario_world",
        f"{WORDS} environment =",
        "environment",
        tables(environment={"wind": {"mode": "force_wind"}}),
    ),
    (
        "scenario_world",
        f"{WORDS} environment.faults loss",
        "environment.faults.0",
        tables(environment={"faults": [{"rotor": "left", "effectiveness": 0.5}]}),
    ),
    (
        "scenario_sensors",
        f"{WORDS} sensors",
        "sensors",
        tables(sensors={"joints": 0.01}),
    ),
    ("scenario_sensors", f"{WORDS} delays", "delays", tables()),
    (
        "scenario_plant",
        f"{WORDS} initial",
        "initial",
        tables(initial={"position": [0.0, 0.0, 2.0]}),
    ),
    ("scenario_reference", f"{WORDS} reference +", "reference", tables()),
    ("scenario_safety", f"{SAFETY}joint_speed", "controller.safety", safe()),
    (
        "scenario_safety",
        f"{SAFETY}tilt -climb -speed -step -step_speed -stiffness -damping -t",
        "controller.safety",
        safe(),
    ),
    (
        "scenario_safety",
        f"{SAFETY}tilt -climb -speed -step -step_speed -stiffness -damping -j",
        "controller.safety",
        safe(),
    ),
    (
        "scenario_world",
        f"{WORDS} environment.wind force_wind",
        "environment.wind",
        tables(
            environment={
                "wind": {
                    "mode": "force_wind",
                    "gust": {"force": [0.1, 0.0, 0.0], **GUST},
                }
            }
        ),
    ),
    (
        "scenario_world",
        f"{WORDS} environment.wind moving_air",
        "environment.wind",
        tables(
            environment={
                "wind": {
                    "mode": "moving_air",
                    "gust": {"velocity": [0.1, 0.0, 0.0], **GUST},
                    "turbulence": {"altitude": 6.0, "wind_20ft": 7.7},
                }
            }
        ),
    ),
    *(
        (
            MADE,
            f"law {law}",
            "controller",
            tables(controller={"law": law}),
        )
        for law in SHIPPED["law"]
    ),
    *(
        (
            MADE,
            "law centroidal",
            "controller",
            led_on(vehicle, **options),
        )
        for vehicle, options in (
            ("hexarotor_arm6", {}),  # a light tip
            ("octo_coaxial_two_arms", {}),  # sliding joints
            ("octo_coaxial_two_arms", {"interaction": [0.3, 0.1]}),
            ("octo_coaxial_two_arms", {"load": 0.5}),
            ("tilted_hexarotor", {"mode": "joint"}),  # no arm
        )
    ),
    (
        "scenario_reference",
        f"{WORDS} controller -->",
        "controller",
        tables(controller={"preset": "centroidal_tip"}),
    ),
    ("scenario_plant", f"{WORDS} initial", "initial", standing()),
    *(
        ("team_laws", f"{RECORD}.world.team.{law}:{kind} -", "team", team(law))
        for law, kind in (
            ("object_wrench", "ObjectWrench"),
            ("leader_follower", "LeaderFollower"),
            ("decentralised", "Decentralised"),
        )
    ),
    ("autopilots", "<!-- generated: law px4", "controller", flown_by("px4")),
    (
        "autopilots",
        f"{RECORD}.links.autopilots.angle_control:AngleGains",
        "controller.gains",
        flown_by("betaflight"),
    ),
    (MADE, "words reference.governor", "reference.governor", governed()),
    (MADE, "record skyarm.reference.tip_plan:TipChoices", "reference.tip", led()),
    (
        MADE,
        "record skyarm.reference.waypoints:FlightLimits",
        "reference.base",
        moved(kind="waypoints", points=[[0, 0, 1], [1, 0, 1]]),
    ),
    ("contact", f"{RECORD}.world.contact:Contact", "world", world()),
    ("contact", f"{RECORD}.world.contact.surface:Surface", "world.surfaces.0", world()),
    (
        "contact",
        f"{RECORD}.world.contact.material:Material",
        "world.surfaces.0.material",
        world(),
    ),
    (
        "contact",
        f"{RECORD}.world.contact.contact_point:ContactPoint",
        "world.points.0",
        world(points=[{"name": "p", "body": "base"}]),
    ),
    (
        "contact",
        f"{RECORD}.world.contact:FreeObject",
        "world.objects.0",
        world(objects=[BOX]),
    ),
    (
        "contact",
        f"{RECORD}.world.contact:Gripper",
        "world.grippers.0",
        world(objects=[BOX], grippers=[{"name": "magnet"}]),
    ),
    (
        "scenario_phases",
        "<!-- generated: guard others",
        "reference.base.phases.0.until",
        moved(
            kind="phases",
            position=[0.0, 0.0, 2.0],
            phases=[{"kind": "hold", "duration": 1.0, "until": {"error": 0.1}}],
        ),
    ),
    (
        "scenario_mechanisms",
        f"{RECORD}.world.contact:Mechanism -->",
        "world.mechanisms.0",
        world(mechanisms=[DOOR]),
    ),
    (
        "scenario_world",
        f"{WORDS} payloads hanging",
        "payloads.0",
        tables(payloads=[{"mass": 0.1, "pick": 0.1}]),
    ),
    (
        "scenario_world",
        f"{WORDS} payloads hanging",
        "payloads.0",
        tables(payloads=[{"mass": 0.1, "pick": 0.1, "kind": "hanging"}]),
    ),
    (
        "scenario_sensors",
        f"{WORDS} estimator ekf",
        "estimator",
        tables(sensors=SENSORS, estimator={"kind": "ekf"}),
    ),
    *(
        (
            "scenario_sensors",
            f"{OF_SENSORS}#{each['kind']}",
            f"sensors.{name}",
            tables(sensors=SENSORS),
        )
        for name, each in SENSORS.items()
    ),
    (
        "actuators",
        f"{RECORD}.dynamics.actuators.servo:PositionServo",
        "plant.drives.joint1",
        tables(
            plant={
                "vehicle": "hummingbird_arm2_rotors",
                "drives": {"joint1": {"kind": "position_servo", **SERVO}},
            }
        ),
    ),
]

VEHICLE = """
schema = 1
name = "written"
base = { mass = 1.0, inertia = [0.01, 0.01, 0.02] }
drag = { area = [0.0, 0.0, 0.0] }
battery.cells = 3
battery.capacity = 2.2
battery.resistance = 0.03
battery.reference_voltage = 11.1
battery.open_circuit = { charge = [0.0, 1.0], voltage = [3.3, 4.2] }
frames = [{ name = "mark" }]
[[links]]
name = "arm"
parent = "base"
mass = 0.1
inertia = [1e-4, 1e-4, 1e-4]
joint = { name = "shoulder", axis = [0, 1, 0] }
[[rotors]]
name = "one"
position = [0.2, 0.0, 0.0]
direction = "ccw"
thrust_table = { speed = [300.0, 900.0], thrust = [1.0, 9.0], torque = [0.02, 0.15] }
"""

OTHER_KIND = re.compile("unknown field|must be a table")
"""Refusal of a key that another kind of the same table has, or has as a table of
errors."""


def literal(cell: str, kind: str) -> Any:
    """Default of a page's cell as a file has it; None for one in words. A vector's
    number is three, of joints two.
    """
    cell = re.sub(r" \(\d+ degrees\)$", "", cell)
    try:
        value = tomllib.loads(f"x = {cell.strip('`')}")["x"]
    except tomllib.TOMLDecodeError:
        return None
    counts = {
        "(3|three) numbers": 3,
        "list of numbers, rad$": 0,
        "(list of numbers|one number for each joint)": 2,
    }
    several = next(
        (count for words, count in counts.items() if re.match(words, kind)), None
    )
    return (
        value
        if several is None or isinstance(value, list)
        else [float(value)] * several
    )


def defaults(page: str, head: str) -> Iterator[tuple[str, Any]]:
    """Field and default of every row of a table that has a default to write; of one
    kind, where the head of the table ends with its name.
    """
    head, _, kind = head.partition("#")
    if page == MADE:
        block = made(head)
    else:
        text = (DOCS / f"{page}.md").read_text("utf-8")
        block = text[text.index("|", text.index(head)) :].split("\n\n")[0]
    at = [
        cell.strip() for cell in block.splitlines()[0].strip("| ").split(" | ")
    ].index("default")
    rows = cells_of(block)
    if kind:
        rows, at = [row[1:] for row in rows if row[0] == f"`{kind}`"], at - 1
    for row in rows:
        # "| `on`, `off` | ... | 0.5, 0.25 |"
        names, cells = re.findall(r"`([\w.]+)`", row[0]), row[at].split(", ")
        for name, cell in zip(
            names,
            cells if len(cells) == len(names) else [row[at]] * len(names),
            strict=True,
        ):
            value = literal(cell, row[1])
            if value is not None:
                yield name, value


def entry(top: Any, path: str) -> Tables:
    """Table at a dotted path, made where it is missing."""
    for step in filter(None, path.split(".")):
        top = top[int(step)] if isinstance(top, list) else top.setdefault(step, {})
    return top


def text(record: Any) -> str:
    """Everything that a record is, integers as integers."""
    return json.dumps(plain(record), sort_keys=True)


OTHER_FORM = ("controller.rate_weights = [1.0, 1.0]", "world.grippers.0.closed = 1")
"""Defaults that the record has in another form when they are written; these are flown,
to the bit."""


def flown(document: Tables) -> tuple[str, list[Any]]:
    """Metrics and paths of a short flight."""
    log = skyarm.run(skyarm.scenario_from(document))
    return repr(score(log, ("standard",))), [
        log.position.tolist(),
        log.joints.tolist(),
        log.rotor_commands.tolist(),
    ]


def changed(
    page: str, head: str, path: str, document: Tables, read: Any = skyarm.scenario_from
) -> list[str]:
    """Lines of a table's defaults that change the record when they are written, or are
    refused.
    """
    every, bare = copy.deepcopy(document), text(read(document))
    lines, alone = list[str](), list[tuple[str, Tables]]()
    for name, value in defaults(page, head):
        *inner, last = name.split(".")
        if inner in (["governor"], ["pick"], ["drop"]):
            continue  # has a page of its own; a place in place of a time
        where, more = ".".join([path, *inner]), copy.deepcopy(document)
        if last not in entry(more, where):
            entry(more, where)[last] = value
            alone.append((f"{where}.{last} = {value}", more))
            entry(every, where)[last] = value
    assert alone
    try:
        if text(read(every)) == bare:
            return []
    except ValueError:
        pass  # some are of another kind
    for line, more in alone:
        try:
            same = text(read(more)) == bare or (
                line in OTHER_FORM and flown(document) == flown(more)
            )
            lines += [] if same else [line]
        except ValueError as error:
            lines += [] if OTHER_KIND.search(str(error)) else [f"{line}: {error}"]
    return lines


@pytest.mark.parametrize(
    ("page", "head", "path", "document"),
    PAGES,
    ids=[f"{p[0]} {p[2]} {p[1][-25:]}" for p in PAGES],
)
def test_a_default_of_a_page_that_is_written_is_the_one_left_out(
    page: str, head: str, path: str, document: Tables
) -> None:
    assert changed(page, head, path, document) == []


@pytest.mark.parametrize("kind", ["joint", "rotors", "body", "drag", "frames", "top"])
def test_a_written_default_of_a_vehicle_file_is_the_one_left_out(kind: str) -> None:
    """A name to each part, and what the page requires."""
    document = tomllib.loads(VEHICLE)
    path = {
        "joint": "links.0.joint",
        "rotors": "rotors.0",
        "body": "base",
        "drag": "drag",
        "frames": "frames.0",
    }
    assert (
        changed(
            "vehicle_files",
            f"<!-- generated: vehicle {kind} -->",
            path.get(kind, ""),
            document,
            vehicle,
        )
        == []
    )


def test_the_default_window_of_the_end_is_that_of_a_shorter_flight() -> None:
    """The page's 5 s, written in a flight of 0.6 s."""
    assert flown(tables(duration=0.6)) == flown(
        tables(duration=0.6, windows={"last": 5})
    )


def test_a_standing_start_may_be_said_to_be_level_and_at_rest() -> None:
    def started(**own: Any) -> Any:
        document = standing()
        document["initial"] |= own
        return skyarm.scenario_from(document).agent.initial

    assert text(
        started(quaternion_wxyz=[1.0, 0.0, 0.0, 0.0], velocity=[0.0, 0.0, 0.0])
    ) == text(started())
    for wrong in (
        {"quaternion_wxyz": [0.0, 1.0, 0.0, 0.0]},
        {"velocity": [0.1, 0.0, 0.0]},
    ):
        with pytest.raises(
            ValueError, match="must be left out of a start that is standing"
        ):
            started(**wrong)


def vehicle(document: Mapping[str, Any]) -> Any:
    """Vehicle of a document; where its numbers come from is another thing: of lags that
    are stated it says so.
    """
    return dataclasses.replace(vehicle_from(document, lambda *_: None), sources=())


def test_a_written_default_of_a_battery_is_the_one_left_out() -> None:
    assert (
        changed(
            "actuators",
            f"{RECORD}.vehicle.battery:Battery",
            "battery",
            tomllib.loads(VEHICLE),
            vehicle,
        )
        == []
    )


@pytest.mark.parametrize("kind", [TaskLimits, PlannedContact, Start, Goal])
def test_a_written_default_of_a_planned_task_is_the_one_left_out(kind: type) -> None:
    def read(document: Tables) -> Any:
        return record_from(kind, Fields(copy.deepcopy(document), ""))

    assert (
        changed(
            "planning_tasks",
            f"{RECORD}.planning.task.{kind.__name__} -->",
            "",
            {},
            read,
        )
        == []
    )


SIGNALS: Mapping[str, Tables] = {
    "sine": {"amplitude": 0.1, "frequency_hz": 1.0},
    "ramp": {"start": 0.1, "duration": 1.0, "height": 0.2},
    "sequence": {"start": 0.1, "segments": [[1.0, 0.3]]},
    "pulses": {"period": 1.0, "width": 0.1, "count": 2},
}


@pytest.mark.parametrize("kind", SIGNALS)
def test_a_written_default_of_a_signal_is_the_one_left_out(kind: str) -> None:
    rows = cells_of(
        (DOCS / "scenario_reference.md")
        .read_text("utf-8")
        .split("<!-- generated: signals -->")[1]
    )
    values = {
        row[1].strip("`"): literal(row[3], row[2])
        for row in rows
        if len(row) > 3 and row[0] == f"`{kind}`"
    }
    stated = {name: value for name, value in values.items() if value is not None}
    assert stated
    bare, full = ({"kind": kind, **SIGNALS[kind], **more} for more in ({}, stated))
    here, there = (moved(kind="signals", x=each, z=1.0) for each in (bare, full))
    assert text(skyarm.scenario_from(here)) == text(skyarm.scenario_from(there))


def test_no_error_of_a_sensor_is_no_error_however_it_is_written() -> None:
    """Zeros of a channel, of dropouts and of the encoder's steps: nothing is drawn for
    them.
    """
    zeros = {"density": 0, "turn_on": 0.0, "walk": 0, "scale": 0, "resolution": 0.0}
    channels = {
        "imu": ("gyro", "accelerometer"),
        "pose": ("position",),
        "encoders": ("joints",),
        "gnss": ("velocity",),
    }
    for kind, names in channels.items():
        for name in names:
            bare = {"kind": kind, name: {"sigma": 0.01}} | (
                {"bits": 0} if kind == "encoders" else {}
            )
            full = bare | {
                name: {"sigma": 0.01, **zeros},
                "latency": 0,
                "dropouts": {"share": 0, "duration": 0.0},
            }
            here, there = (
                skyarm.scenario_from(tables(sensors={"one": each}))
                for each in (bare, full)
            )
            assert text(here) == text(there), f"{kind}.{name}"


NOISY = tables(
    duration=0.25,
    sensors={
        "imu": {"kind": "imu", "gyro": {"density": 0.005}},
        "encoders": {"kind": "encoders", "joints": {"sigma": 1e-3}},
        "pose": {"kind": "pose"},
    },
    estimator={"kind": "ekf"},
    environment={
        "ground": False,
        "wind": {"mode": "force_wind", "force": [0.1, 0.0, 0.0]},
    },
)


def test_a_noisy_flight_with_every_default_written_has_the_same_bits() -> None:
    more = copy.deepcopy(NOISY)
    for page, head, path in (
        ("scenario_sensors", f"{WORDS} estimator ekf", "estimator"),
        ("scenario_sensors", f"{OF_SENSORS}#encoders", "sensors.encoders"),
        ("scenario_world", f"{WORDS} environment.wind force_wind", "environment.wind"),
        ("scenario_sensors", f"{WORDS} sensors", "sensors"),
        ("scenario_sensors", f"{WORDS} delays", "delays"),
        ("scenario_files", f"{WORDS} rates", "rates"),
    ):
        for name, value in defaults(page, head):
            if "." not in name and (
                name in ("bits", "rates") or path != "sensors.encoders"
            ):
                entry(more, path).setdefault(name, value)
    entry(more, "sensors.imu.gyro").update(walk=0, turn_on=0, sigma=0.0)
    entry(more, "sensors.encoders.joints").update(density=0, walk=0, resolution=0)
    here, there = (skyarm.run(skyarm.scenario_from(each)) for each in (NOISY, more))
    assert len(entry(more, "estimator")) > 15
    for name in ("position", "joints", "rotor_commands"):
        assert np.array_equal(getattr(here, name), getattr(there, name))


@pytest.mark.parametrize("bits", [0, 0.0])
def test_an_encoder_of_no_bits_has_no_steps(bits: float) -> None:
    flight = tables(duration=0.2, sensors={"enc": {"kind": "encoders", "bits": bits}})
    log = skyarm.run(skyarm.scenario_from(flight))
    assert np.array_equal(np.array(log.readings["enc"]["joints"]), log.joints)
    varied = skyarm.scenario_from(
        flight | {"sensors": {"enc": {"kind": "encoders", "bits": 8}}}
    )
    none = skyarm.run(with_numbers(varied, {"sensors.enc.bits": 0.0}))
    assert np.array_equal(np.array(none.readings["enc"]["joints"]), none.joints)


def test_steps_of_an_encoder_are_either_bits_or_a_resolution() -> None:
    stated = {"kind": "encoders", "bits": 0, "joints": {"resolution": 0.01}}
    skyarm.scenario_from(tables(sensors={"enc": stated}))
    with pytest.raises(
        ValueError, match=r"bits = 12.*: must be 0 where joints\.resolution is given"
    ):
        skyarm.scenario_from(tables(sensors={"enc": stated | {"bits": 12}}))
