"""Cost of twenty shapes of a vehicle in a batch, beside the same batch without them.

python tests/studies/bench/measure_shapes.py [rounds]

The paper's vehicle flies over a floor, alone or among four boxes: far from everything,
or a tenth of the time so near the floor that twenty pairs are looked at.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any

from bench_engines import Flight
from bench_timing import Contender, contest
from contact_speed import PATHS, plant_of

from skyarm.compile.llvm.kernel import Kernel, host_width
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.scenario.scenario_file import scenario_from
from skyarm.scenario.scenario_record import Scenario
from support.shaped import shaped

VEHICLE = "hummingbird_arm2_rotors"
SIZES = {
    "sphere": [0.02],
    "capsule": [0.015, 0.04],
    "box": [0.04, 0.05, 0.03],
    "cylinder": [0.02, 0.04],
}
LOW = 0.345
"""Height (m) asked for near the floor; 20 pairs are near, and none touches."""


def scene(folder: Path, boxes: int, *, shapes: bool, near: bool) -> Scenario:
    """The paper's vehicle over a floor and among boxes, with twenty shapes or none.

    Near the floor all are under the base, else half of them are on the links.
    """
    kinds = [*SIZES] * 5
    links = ["base"] if near else ["base", "base", "link1", "link2"]
    rows = [
        {
            "shape": kind,
            "size": SIZES[kind],
            "link": links[i // 4 % len(links)],
            "position": [0.06 * (i % 5 - 2), 0.07 * (i // 5 - 1.5), -0.25]
            if near
            else [0.01 * (i % 5), 0.0, -0.1],
        }
        for i, kind in enumerate(kinds)
    ]
    down = [[2.0, LOW - 1.0], [0.3, LOW - 1.0], [2.0, 0.0]]
    dip: dict[str, Any] = {
        "kind": "sequence",
        "start": 0.5,
        "segments": down,
        "shape": "quintic",
    }
    around = [(3.0, 0.0), (0.0, 3.0), (-3.0, 0.0), (0.0, -3.0)][:boxes]
    return scenario_from(
        {
            "schema": 1,
            "name": "shapes",
            "duration": 10.0,
            "plant": {"vehicle": shaped(folder, rows, VEHICLE) if shapes else VEHICLE},
            "model": {"vehicle": "hummingbird_arm2"},
            "controller": {"preset": "paper_ct"},
            "reference": {
                "base": {"kind": "signals", "z": [1.0, *([dip] if near else [])]},
                "joints": [-1.2, 0.3],
            },
            "world": {
                "surfaces": [
                    {"name": "floor", "shape": "plane"},
                    *(
                        {
                            "name": f"box{i}",
                            "shape": "box",
                            "size": [1.0, 1.0, 1.0],
                            "position": [x, y, 0.5],
                        }
                        for i, (x, y) in enumerate(around)
                    ),
                ]
            },
        },
        folder,
    )


def flight_of(scenario: Scenario) -> Flight:
    """Closed loop of a scenario in the steps that its plant takes."""
    return Flight.of(scenario, plant_of(scenario).substeps, paths=PATHS)


def contenders(folder: Path, boxes: int, blocks: int, *, near: bool) -> list[Contender]:
    """The batch without shapes, which is the baseline, and with them, in f64."""
    lanes = Lanes(host_width(), contract=True)
    found = []
    for shapes in (False, True):
        flight = flight_of(scene(folder, boxes, shapes=shapes, near=near))
        fly = flight.runner(Kernel(flight.loop, lanes), blocks * lanes.width, 1)
        name = "20 shapes" if shapes else "none"
        found.append(Contender(name, f"{boxes + 1} surfaces", fly))
    return found


def main(rounds: int, blocks: int = 16) -> None:
    """Print the speed with shapes in parts of that without."""
    with tempfile.TemporaryDirectory() as folder:
        for near in (False, True):
            for boxes in (0, 4):
                rivals = contenders(Path(folder), boxes, blocks, near=near)
                shapes = contest(rivals, rounds)[1]
                where = "near a tenth of the time" if near else "near nothing"
                print(f"{shapes.work_ratio:.3f}  {where}, {shapes.what}", flush=True)


if __name__ == "__main__":
    main(int((*sys.argv[1:], "9")[0]))
