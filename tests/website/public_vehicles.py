"""Picture of ten public vehicles, each read from its own file, with mass and number of
rotors as read.

    python tests/website/public_vehicles.py FOLDER     writes
                                                       docs/images/public_vehicles.svg

FOLDER has checkouts of the public repositories, each under its own name; a vehicle
whose file is not there is left out, with a line. Where a file has gaps, lags and speeds
of our own fill them, which the picture does not show.
"""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

# the tests' own modules, when this is run as a program
sys.path.append(str(Path(__file__).parents[1]))

from centroidal_drawings import FOLDER, STYLE, WIDTH, text
from matplotlib.colors import to_hex

from skyarm import load_vehicle
from skyarm.vehicle import BASE, Vehicle
from skyarm.view.figures.style import PAPER
from skyarm.view.figures.vehicle_drawing import CORNER, Posed, Sheet

DRAWING = FOLDER / "public_vehicles.svg"
TITLE = "Ten public vehicles, drawn by skyarm from their own files"

LAGS = "time_constant_up = 0.02\ntime_constant_down = 0.03\n"
GAPS = f"[rotor_defaults]\n{LAGS}"
FAST = f"{GAPS}max_speed = 1000.0\n"


def held(angles: dict[str, float]) -> str:
    return "".join(
        f'[[joints]]\nname = "{name}"\nhold = {angle}\n'
        for name, angle in angles.items()
    )


def rotors_sim(name: str) -> tuple[str, str]:
    """File and vehicle table of a vehicle of RotorS, with the arguments of its launch
    file.
    """
    unused = (
        "enable_logging",
        "enable_ground_truth",
        "enable_mavlink_interface",
        "wait_to_record_bag",
        "log_file",
    )
    arguments = {"mav_name": name, "namespace": name, **dict.fromkeys(unused, "false")}
    table = "".join(f'{key} = "{value}"\n' for key, value in arguments.items())
    return (
        f"rotors_simulator/rotors_description/urdf/{name}_base.xacro",
        f'inertia_repair = "nearest"\n[xacro]\n{table}',
    )


SENSES = ("cw", "ccw", "cw", "ccw")
VEHICLES: dict[str, tuple[str, str, str]] = {
    "x500": ("PX4, SDF", "PX4-gazebo-models/models/x500/model.sdf", ""),
    "omnicopter": ("PX4, SDF", "PX4-gazebo-models/models/omnicopter/model.sdf", ""),
    "hummingbird": ("RotorS, xacro", *rotors_sim("hummingbird")),
    "pelican": ("RotorS, xacro", *rotors_sim("pelican")),
    "firefly": ("RotorS, xacro", *rotors_sim("firefly")),
    "X2": ("MuJoCo Menagerie, MJCF", "mujoco_menagerie/skydio_x2/x2.xml", FAST),
    "cf2x": (
        "gym-pybullet-drones, URDF",
        "gym-pybullet-drones/gym_pybullet_drones/assets/cf2x.urdf",
        GAPS
        + "".join(
            f'[[rotors]]\nname = "prop{k}_link"\ndirection = "{sense}"\n'
            for k, sense in enumerate(SENSES)
        ),
    ),
    "mini_quadrotor": (
        "JSK, xacro",
        "jsk_aerial_robot/robots/mini_quadrotor/urdf/robot.urdf.xacro",
        FAST,
    ),
    "hydrus_xi": (
        "JSK, xacro",
        "jsk_aerial_robot/robots/hydrus_xi/robots/hex_branch/default.urdf.xacro",
        FAST
        + held(
            {f"gimbal{k}": 0.0 for k in range(1, 7)}
            | {f"joint{k}": 0.7 for k in range(1, 7)}
        ),
    ),
    "s500_uam": (
        "eagle-mpc, URDF and YAML",
        "eagle-mpc-python/models/s500_uam/urdf/s500_uam.urdf",
        "[rotor_file]\nfile ="
        ' "{folder}/eagle-mpc-python/config/yaml/multicopter/s500.yaml"\n'
        + GAPS
        + held({f"rotor_joint_{k}": 0.0 for k in range(1, 5)}),
    ),
}
"""Name -> source and format, file, rest of the vehicle file that reads it."""

KINDS = {".sdf": "sdf", ".xml": "mjcf", ".urdf": "urdf", ".xacro": "urdf"}

ACROSS, WIDE, HIGH = 2, WIDTH / 2, 150.0  # px, of a cell
ROOM = WIDE - 24.0, 92.0  # px, of a vehicle in its cell
STEP = 1.0  # px, least, along an outline


def read(name: str, folder: Path) -> Vehicle | None:
    """Vehicle of a file in the folder; None, with a line, where it is not there."""
    _, file, rest = VEHICLES[name]
    path = folder.resolve() / file
    if not path.is_file():
        print(f"{name}: left out, no file {path}")
        return None
    with TemporaryDirectory() as made:
        own = Path(made) / "public.toml"
        head = (
            f'schema = 1\nname = "{name}"\n{KINDS[path.suffix]} = "{path.as_posix()}"\n'
        )
        own.write_text(
            head + rest.replace("{folder}", folder.resolve().as_posix()), "utf-8"
        )
        return load_vehicle(own)


def bodies(vehicle: Vehicle, x: float, y: float) -> list[str]:
    """Outlines of the product's own drawing, in the middle of a place."""
    # frames of the base would each be a rod: sensors, batteries, and all that fixed
    # joints hold
    vehicle = replace(
        vehicle, frames=tuple(each for each in vehicle.frames if each.link != BASE)
    )
    sheet = Sheet(
        PAPER.blank(1.0, 1.0).add_axes((0.0, 0.0, 1.0, 1.0)), CORNER, Posed(vehicle)
    )
    outlines = [
        (each.get_xy(), to_hex(each.get_facecolor()), each.get_alpha())
        for each in sheet.ax.patches
    ]
    low = [min(corners[:, k].min() for corners, *_ in outlines) for k in (0, 1)]
    high = [max(corners[:, k].max() for corners, *_ in outlines) for k in (0, 1)]
    scale = min(room / (b - a) for room, a, b in zip(ROOM, low, high, strict=True))
    parts = []
    for corners, fill, alpha in outlines:
        right = x + scale * (corners[:, 0] - 0.5 * (low[0] + high[0]))
        down = y - scale * (corners[:, 1] - 0.5 * (low[1] + high[1]))
        points = [(right[0], down[0])]
        points += [
            each
            for each in zip(right, down, strict=True)
            if math.dist(each, points[-1]) > STEP
        ]
        path = "L".join(f"{a:.1f} {b:.1f}" for a, b in points)
        parts.append(f'<path d="M{path}z" fill="{fill}" fill-opacity="{alpha:g}"/>')
    return parts


def drawing(vehicles: dict[str, Vehicle]) -> str:
    """Picture as wide as a telephone, two vehicles in a row."""
    rows = -(-len(vehicles) // ACROSS)
    parts = [
        (
            '<svg xmlns="http://www.w3.org/2000/svg" class="narrow" viewBox="0 0'
            f' {WIDTH} {HIGH * rows:g}" width="{WIDTH}" height="{HIGH * rows:g}"'
            ' font-family="sans-serif" stroke="currentColor" stroke-width="0.5">'
        ),
        STYLE,
        f"<title>{TITLE}</title>",
    ]
    for k, (name, vehicle) in enumerate(vehicles.items()):
        x, y = WIDE * (k % ACROSS + 0.5), HIGH * (k // ACROSS)
        parts += bodies(vehicle, x, y + 0.5 * ROOM[1] + 6.0)
        facts = f"{float(vehicle.mass):.4g} kg, {len(vehicle.rotors)} rotors"
        words = (name, facts, VEHICLES[name][0])
        parts += [
            text(x, y + 114.0 + 15.0 * i, each, size=12, bold=not i)
            for i, each in enumerate(words)
        ]
    return "\n".join([*parts, "</svg>"]) + "\n"


def main(folder: str) -> int:
    vehicles = {
        name: vehicle for name in VEHICLES if (vehicle := read(name, Path(folder)))
    }
    if not vehicles:
        return 1
    DRAWING.write_text(drawing(vehicles), "utf-8")
    print(DRAWING)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
