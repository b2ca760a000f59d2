"""Drawn scenes in which vehicles touch with their shapes, and how far two plants part.

Every flight is well-posed: it touches at moderate speeds, away from corners, and ends
at rest where its reference leads it, in free air, on its legs or with a box in its
fingers. Run it to compare all scenes on both plants, or those whose names are given; a
number is another seed.
"""

from __future__ import annotations

import math
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import skyarm
from skyarm.dynamics import frame_pose
from skyarm.scenario.scenario_file import scenario_from
from skyarm.world.contact.vehicle_bodies import BodyPair

SEED = 97
APART = 5.0
"""Distance (mm) between both plants at the end below which they agree."""

TOUCH = 0.05
"""Normal force (N) from which two bodies are said to have touched."""

EXAMPLES = Path(__file__).parents[3] / "examples"
PLANTS = {
    "rigid_body": {"kind": "rigid_body"},
    "mujoco": {"kind": "mujoco", "contact": "geoms"},
}
MATERIAL = {"friction": 0.4, "dissipation": 30.0}
Table = dict[str, Any]


def shape(name: str, kind: str, size: list[float], **fields: Any) -> Table:
    """Table of a shape of the base, if no field says another body."""
    return {"name": name, "shape": kind, "size": size, **fields}


def toml(table: Table) -> str:
    """Text of a table of words, numbers and lists of these."""
    rows = [f"{k} = {v!r}".replace("'", '"') for k, v in table.items()]
    return "[[collisions]]\n" + "\n".join(rows) + "\n"


def vehicle_file(folder: Path, name: str, airframe: str, shapes: list[Table]) -> str:
    """Path of a file of a shipped vehicle with shapes."""
    head = f'schema = 1\nname = "{name}"\nairframe = "{airframe}"\n'
    path = folder / f"{name}.toml"
    path.write_text(head + "".join(map(toml, shapes)), "utf-8")
    return str(path)


def rods(airframe: str, radius: float) -> list[Table]:
    """Capsules along the links of an arm, from joint to joint and to its tip."""
    vehicle = skyarm.load_vehicle(airframe)
    shapes = []
    for i, link in enumerate(vehicle.moving):
        below = [each.joint.position for each in vehicle.moving if each.parent == i]
        below += [each.position for each in vehicle.frames if each.link == i]
        end = np.array([*below[-1]], float)
        length = float(np.linalg.norm(end))
        if length > 2.1 * radius:
            across = math.hypot(end[0], end[1])
            way = [0.0, math.atan2(across, end[2]), math.atan2(end[1], end[0])]
            middle = [float(each) for each in 0.5 * end]
            size = [radius, length - 2.0 * radius]
            where = {"link": link.name, "position": middle, "rpy": way}
            shapes.append(shape(link.name, "capsule", size, **where))
    return shapes


def tip_of(airframe: str, joints: list[float]) -> tuple[float, ...]:
    """Place (m) of the tip in the base's axes."""
    vehicle = skyarm.load_vehicle(airframe)
    return tuple(map(float, frame_pose(vehicle, vehicle.frame(), joints).p))


def there_and_back(way: float, stay: float) -> Table:
    """Signal that goes to a value within 1 s, stays, and comes back within 1 s."""
    segments = [[1.0, way], [stay, way], [1.0, 0.0]]
    return {"kind": "sequence", "start": 0.3, "segments": segments, "shape": "quintic"}


def base_on(at: list[float], *ways: Table | None) -> Table:
    """Reference of a base that moves from a place along its axes."""
    signals = {
        axis: [{"kind": "constant", "value": start}, *([way] if way else [])]
        for axis, start, way in zip("xyz", at, ways, strict=True)
    }
    return {"kind": "signals", **signals}


def scene(vehicle: str, at: list[float], base: Table, **world: Any) -> Table:
    """Tables of a flight of one vehicle."""
    return {
        "name": "drawn",
        "duration": 4.0,
        "plant": {"vehicle": vehicle},
        "controller": {"law": "centroidal"},
        "initial": {"position": at},
        "reference": {"base": base},
        "world": {"vehicle_material": MATERIAL, **world},
    }


def surface(name: str, **fields: Any) -> Table:
    """Table of a surface of the material of all scenes."""
    return {"name": name, "material": MATERIAL, **fields}


ARMS = {
    "hummingbird_arm2_rotors": ([-0.5, 1.0], [0.06, -0.12]),
    "pelican_arm2": ([-0.6, 1.1], [0.08, -0.16]),
    "quadrotor_roll_arm2": ([0.0, 0.4], [0.0, -0.15]),
    "hexacopter370_flying_arm_3": ([-0.4, 0.9, 0.2], [0.08, -0.16, 0.0]),
}
"""Shipped vehicles with arms: a bent posture (rad), and a change of it that reaches
farther down."""


def table(rng: np.random.Generator, folder: Path, index: int) -> Table:
    """Arm above a table, down to which either the base or the joints lead its tip."""
    airframe = [*ARMS][index % len(ARMS)]
    bent, reach = ARMS[airframe]
    size = float(rng.uniform(0.012, 0.02))
    vehicle = vehicle_file(folder, f"table_{index}", airframe, rods(airframe, size))
    x, y, low = tip_of(airframe, bent)
    gap, press = float(rng.uniform(0.005, 0.015)), float(rng.uniform(0.005, 0.015))
    joints: list[Any] = list(bent)
    base = base_on([0.0, 0.0, 1.0], None, None, None)
    if index >= len(ARMS):
        base = base_on([0.0, 0.0, 1.0], None, None, there_and_back(-gap - press, 0.6))
    else:
        lower = tip_of(airframe, [a + b for a, b in zip(bent, reach, strict=True)])[2]
        gap = max(low - lower - press, 0.004)
        joints = [
            [{"kind": "constant", "value": a}, there_and_back(b, 0.6)]
            for a, b in zip(bent, reach, strict=True)
        ]
    top = 1.0 + low - gap

    world = surface(
        "table", shape="box", size=[0.5, 0.5, 0.1], position=[x, y, top - 0.05]
    )
    made = scene(vehicle, [0.0, 0.0, 1.0], base, surfaces=[world])
    made["initial"]["joints"] = bent
    made["reference"]["joints"] = joints
    return made


def leg(rng: np.random.Generator, folder: Path, index: int) -> Table:
    """Arm whose second link swings against a rail of its own vehicle."""
    airframe = ["hummingbird_arm2_rotors", "pelican_arm2"][index % 2]
    radius = 0.012
    start, end = tip_of(airframe, [0.0, 0.0])[2], -0.15
    height = 0.5 * (start + end) + float(rng.uniform(-0.02, 0.02))
    away = float(rng.uniform(0.06, 0.1)) * (1 if index % 3 else -1)
    kind, size = [("capsule", [radius, 0.2]), ("cylinder", [radius, 0.2])][index % 2]
    if index == 4:
        kind, size = "box", [2.0 * radius, 2.0 * radius, 0.2]
    rail = shape(
        "rail", kind, size, position=[away, 0.0, height], rpy=[0.5 * math.pi, 0.0, 0.0]
    )
    arm = rods(airframe, radius)
    vehicle = vehicle_file(folder, f"leg_{index}", airframe, [rail, *arm])
    root = {"hummingbird_arm2_rotors": 0.0, "pelican_arm2": -0.04}[airframe]
    touch = math.atan2(away, root - height)
    meets = touch - math.copysign(2.0 * radius / math.hypot(away, root - height), touch)
    turn = -(meets + math.copysign(float(rng.uniform(0.04, 0.1)), touch))
    made = scene(
        vehicle,
        [0.0, 0.0, 1.0],
        base_on([0.0, 0.0, 1.0], None, None, None),
        self_collision=True,
    )
    made["reference"]["joints"] = [[there_and_back(turn, 0.6)], 0.0]
    return made


def wall(rng: np.random.Generator, folder: Path, index: int) -> Table:
    """Vehicle whose guard comes against a wall."""
    airframe = ["hummingbird", "hummingbird_arm2_rotors", "dragonfly"][index % 3]
    kind, size, reach = [
        ("sphere", [0.28], 0.28),
        ("cylinder", [0.28, 0.06], 0.28),
        ("box", [0.5, 0.5, 0.06], 0.25),
        ("cylinder", [0.27, 0.1], 0.27),
        ("sphere", [0.26], 0.26),
    ][index]
    vehicle = vehicle_file(
        folder, f"wall_{index}", airframe, [shape("guard", kind, size)]
    )
    gap, press = float(rng.uniform(0.01, 0.05)), float(rng.uniform(0.01, 0.03))
    side = 1.0 if index % 2 else -1.0
    place = reach + gap + 0.1
    world = surface(
        "wall", shape="box", size=[0.2, 2.0, 1.0], position=[side * place, 0.0, 1.0]
    )
    base = base_on(
        [0.0, 0.0, 1.0], there_and_back(side * (gap + press), 0.6), None, None
    )
    return scene(vehicle, [0.0, 0.0, 1.0], base, surfaces=[world])


def team(rng: np.random.Generator, folder: Path, index: int) -> Table:
    """Vehicle that comes against another, which hovers."""
    airframe = ["hummingbird", "dragonfly"][index % 2]
    kind, size, reach = [
        ("sphere", [0.25], 0.25),
        ("cylinder", [0.25, 0.1], 0.25),
        ("box", [0.5, 0.5, 0.1], 0.25),
        ("sphere", [0.22], 0.22),
    ][index]
    vehicle = vehicle_file(
        folder, f"team_{index}", airframe, [shape("guard", kind, size)]
    )
    gap, press = float(rng.uniform(0.02, 0.05)), float(rng.uniform(0.01, 0.02))
    up = float(rng.uniform(-0.02, 0.02))
    starts = {"left": [0.0, 0.5 * gap + reach, 1.0]}
    starts["right"] = [0.0, -0.5 * gap - reach, 1.0 + up]
    made = scene(vehicle, [0.0, 0.0, 1.0], {})
    del made["initial"], made["reference"]
    made["agents"] = {
        name: {
            "initial": {"position": at},
            "reference": {
                "base": base_on(
                    at,
                    None,
                    there_and_back(gap + press, 0.6) if name == "right" else None,
                    None,
                )
            },
        }
        for name, at in starts.items()
    }
    return made


def fingers(rng: np.random.Generator, folder: Path, index: int) -> Table:
    """Two fingers that each have a drive of their own, and lift a box."""
    text = (EXAMPLES / "two_fingers.toml").read_text("utf-8")
    text = text.replace('mimic = "couple"\n', "")
    text = text.replace('mimic = { joint = "left_slide", ratio = -1.0 }\n', "")
    drive = text[text.index("[drives.left_slide]") :]
    text += "\n" + drive.replace("left_slide", "right_slide")
    path = folder / f"fingers_{index}.toml"
    path.write_text(text, "utf-8")
    wide, friction = float(rng.uniform(0.025, 0.035)), float(rng.uniform(0.6, 0.9))
    high = float(rng.uniform(0.025, 0.035))
    material = {"friction": friction, "dissipation": 30.0}
    box = {
        "name": "box",
        "mass": float(rng.uniform(0.03, 0.06)),
        "size": [0.03, wide, high],
        "position": [0.0, 0.0, 0.9 + 0.5 * high],
        "standing": True,
        "material": material,
    }
    post = surface(
        "post", shape="box", size=[0.02, 0.02, 0.9], position=[0.0, 0.0, 0.45]
    )
    close = {"kind": "sequence", "start": 0.3, "shape": "quintic"}
    lift = {"kind": "sequence", "start": 1.6, "segments": [[1.5, 0.2]]}
    at = [0.0, 0.0, 1.025]
    made = scene(
        str(path),
        at,
        base_on(at, None, None, {**lift, "shape": "quintic"}),
        surfaces=[post],
        objects=[box],
    )
    made["world"]["vehicle_material"] = material
    made["initial"]["joints"] = [0.03, -0.03]
    # the drive presses by its stiffness times 13 mm, 26 N at most
    made["reference"]["joints"] = [
        [
            {"kind": "constant", "value": side * 0.03},
            {**close, "segments": [[1.0, side * (0.5 * wide - 0.043)]]},
        ]
        for side in (1.0, -1.0)
    ]
    return made


def landing(rng: np.random.Generator, folder: Path, index: int) -> Table:
    """Vehicle that comes down on its legs, and stays there."""
    airframe = ["hummingbird", "dragonfly"][index % 2]
    low = float(rng.uniform(0.1, 0.14))
    half = float(rng.uniform(0.08, 0.12))
    along = [0.0, 0.5 * math.pi, 0.0]
    corners = [(a, b) for a in (-half, half) for b in (-half, half)]
    legs = [
        [
            shape(f"s{i}", "capsule", [0.01, 0.25], position=[0.0, y, -low], rpy=along)
            for i, y in enumerate((-half, half))
        ],
        [
            shape(f"s{i}", "sphere", [0.01], position=[x, y, -low])
            for i, (x, y) in enumerate(corners)
        ],
        [
            shape(f"s{i}", "box", [0.02, 0.02, 0.1], position=[x, y, 0.04 - low])
            for i, (x, y) in enumerate(corners)
        ],
        [
            shape(f"s{i}", "cylinder", [0.01, 0.25], position=[0.0, y, -low], rpy=along)
            for i, y in enumerate((-half, half))
        ],
    ][index]
    vehicle = vehicle_file(folder, f"landing_{index}", airframe, legs)
    ground = surface("ground")
    high = 0.01 + low
    down = {"kind": "sequence", "start": 0.3, "segments": [[1.5, -0.105]]}
    at = [0.0, 0.0, high + 0.1]
    base = base_on(at, None, None, {**down, "shape": "quintic"})
    return scene(vehicle, at, base, surfaces=[ground])


FAMILIES: dict[str, tuple[Callable[..., Table], int]] = {
    "table": (table, 8),
    "leg": (leg, 5),
    "wall": (wall, 5),
    "team": (team, 4),
    "fingers": (fingers, 4),
    "landing": (landing, 4),
}
"""Function that draws a scene of each family, and how many there are."""

NAMES = tuple(f"{name}_{i}" for name, (_, n) in FAMILIES.items() for i in range(n))


def drawn(name: str, folder: Path, seed: int = SEED) -> Table:
    """Tables of the scene of a name, whose vehicle is written to a folder."""
    family, index = name.split("_")
    draw, _ = FAMILIES[family]
    seeds = (seed, [*FAMILIES].index(family), int(index))
    return draw(np.random.default_rng(seeds), folder, int(index))


@dataclass
class Ends:
    """What is compared of a flight: status, pairs of bodies that touched, with their
    largest normal forces (N), and places (m) of vehicles and objects at the end.
    """

    status: str
    touched: dict[str, float]
    places: np.ndarray


def flown(tables: Table, plant: str) -> Ends:
    """Flight of a scene on a plant."""
    tables = {**tables, "plant": {**tables["plant"], **PLANTS[plant]}}
    scenario = scenario_from(tables, Path())
    log = skyarm.run(scenario)
    forces = log.component("collision_force").max(axis=0)
    names = [pair.name for pair in pairs_in(scenario)]
    places = [each.position[-1] for each in log.agents.values()]
    if scenario.world.objects:
        places.append(log.component("object_position")[-1])
    return Ends(
        status=log.info["status"],
        touched={
            name: float(force)
            for name, force in zip(names, forces, strict=True)
            if force > TOUCH
        },
        places=np.concatenate([np.ravel(each) for each in places]),
    )


def pairs_in(scenario: skyarm.Scenario) -> Sequence[BodyPair]:
    """Pairs of bodies that may touch in a scenario."""
    agents = {name: each.vehicle for name, each in scenario.agents.items()}
    return scenario.world.on(agents).body_pairs


def compared(
    name: str, folder: Path, seed: int = SEED
) -> tuple[dict[str, Ends], float]:
    """Both flights of a scene, by plant, and how far they are apart at the end (mm)."""
    tables = drawn(name, folder, seed)
    ends = {plant: flown(tables, plant) for plant in PLANTS}
    own, other = (each.places for each in ends.values())
    return ends, 1e3 * float(np.abs(own - other).max())


def main(names: Sequence[str], seed: int = SEED) -> None:
    """Print how far both plants part in each scene."""
    agreeing = 0
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            ends, apart = compared(name, Path(folder), seed)
        own, other = ends.values()
        alike = own.status == other.status
        alike &= own.touched.keys() == other.touched.keys() and apart < APART
        agreeing += alike
        print(f"{name}: {'same' if alike else 'OTHER'}, {apart:.3f} mm apart")
        for each in (own, other):
            forces = {key: round(force, 3) for key, force in each.touched.items()}
            print(f"  {each.status} {forces}")
        sys.stdout.flush()
    print(f"{agreeing} of {len(names)}")


if __name__ == "__main__":
    given = sys.argv[1:]
    seeds = (int(each) for each in given if each.isdigit())
    main([each for each in given if not each.isdigit()] or NAMES, *seeds)
