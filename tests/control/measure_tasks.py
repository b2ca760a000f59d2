"""Measure the rows of contact tasks that a batch of pushes does not show: winds, edges,
loads, handles, pegs.

    python tests/control/measure_tasks.py winds|edges|loads|handles|pegs
        [--seeds 20] [--seed 5] [--small]

Tables of docs/data/results_contact.md. Noise is that of ``measure_pressing.py``.
"""

import dataclasses
import sys
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

import numpy as np

# the tests' own modules, when run as a program
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from measure_pressing_scenes import NOISE, VEHICLES, scene_document

import skyarm
from skyarm.algebra import Vec3
from skyarm.algebra.scalars import logical_and, maximum, where
from skyarm.scenario.numbers import number_at
from skyarm.scenario.scenario_file import scenario_from
from skyarm.sensing.measurement import SensorNoise
from skyarm.simulate.batch import Batch
from skyarm.studies.compare.contact_tasks import RADIUS, TASKS
from skyarm.studies.trial.trial import columns_of
from skyarm.world.component import Force, Wrench
from support.measured_tables import mean_and_largest, print_part

ROOT = Path(__file__).resolve().parents[2]

SIDES = {
    "into the wall": (2.0, 0.0),
    "away from the wall": (-2.0, 0.0),
    "to the left": (0.0, 2.0),
    "to the right": (0.0, -2.0),
}
"""Wind of 2 N along x and y, world axes: the wall stands ahead."""

EDGE = 1.42
"""m, height at which the wall ends; the tip begins 15 cm below."""

PICK, LIFT, CARRY, DOWN, DROP = 1.0, 1.5, 4.2, 6.9, 9.6
"""s, of a load: it is taken, lifted 0.3 m in 2.2 s, carried 0.5 m in 2.2 s, lowered,
let go."""

LOADS = {  # posture, largest mass that is learned (kg), options of the law, masses (kg)
    "arm2": ([0.5, -1.0], 0.3, {}, (0.15,)),
    "arm6": (
        [0.0, 0.6, -1.0, 0.0, 0.5, 0.0],
        0.6,
        {"reach": 0.24, "damping": 0.06},
        (0.5,),
    ),
}


def singly(scenario, seeds, seed, read):
    """Flights one by one: how many completed, and numbers of these by their words;
    ``read`` has them from a log.
    """
    logs = [
        skyarm.run(dataclasses.replace(scenario, seed=seed, episode=k))
        for k in range(seeds)
    ]
    found = [read(log) for log in logs if log.status == "completed"]
    numbers = {
        word: [each[word] for each in found] for word in (found[0] if found else ())
    }
    return f"{len(found)} of {len(logs)}", defaultdict(list, numbers)


def touched(log):
    """s, of the first touch."""
    return log.time[np.argmax(log.contact_force[:, 0] > 0.0)]


def winds(seeds, seed):
    """arm6 holds 5 N, and wind comes and goes in steps: the largest error of the force
    from 2 s after the touch on.
    """
    for noisy in (False, True):
        for side, (x, y) in SIDES.items():
            if side == "to the right" and not noisy:
                continue  # without noise as to the left
            document = scene_document("arm6", noisy=noisy)
            document["reference"]["push"]["force"]["value"] = 5.0
            gust = {"force": [x, y, 0.0], "start": 5.0, "duration": 2.5}
            document["environment"] = {"wind": {"mode": "force_wind", "gust": gust}}

            def read(log):
                force = log.contact_force[log.time > touched(log) + 2.0, 0]
                return {
                    "error": np.abs(force - 5.0).max(),
                    "lost": float((force <= 0.0).any()),
                }

            completed, found = singly(
                scenario_from(document), seeds if noisy else 1, seed, read
            )
            told = "noisy" if noisy else "perfect"
            title = side if noisy or side != "to the left" else "to a side"
            sizes = mean_and_largest(found["error"], 3)
            yield title, told, completed, *sizes, f"{sum(found['lost']):.0f}"


def edges(seeds, seed):
    """arm6 slides up with 5 N beyond the end of the wall: how far the tip goes past its
    face in 0.3 s.
    """
    for sensor in (False, True):
        document = scene_document("arm6", slide=0.5)
        document["duration"] = 7.0
        document["reference"]["push"]["force"]["value"] = 5.0
        wall = document["world"]["surfaces"][0]
        wall["size"][2], wall["position"][2] = EDGE, 0.5 * EDGE
        if sensor:
            document["sensors"] |= {
                "wrist": {"kind": "force_torque", "force": {"sigma": 0.05}}
            }
            document["controller"]["force_sensor"] = True
        face = wall["position"][0] - 0.5 * wall["size"][0]

        def read(log, face=face):
            over = log.time[np.argmax(log.tip[:, 2] > EDGE)]
            before = log.contact_force[
                (log.time > touched(log) + 0.3) & (log.time < over), 0
            ]
            after = (log.time >= over) & (log.time <= over + 0.3)
            return {
                "past": 1e3 * (log.tip[after, 0] - face).max(),
                "lost": float((before <= 0.0).any()),
            }

        completed, found = singly(scenario_from(document), seeds, seed, read)
        sizes = mean_and_largest(found["past"], 1)
        yield (
            "force sensor" if sensor else "none",
            completed,
            *sizes,
            f"{sum(found['lost']):.0f}",
        )


@dataclass(frozen=True, kw_only=True)
class Support(Force):
    """A spring under the tip that bears a load where it was taken, until the tip lifts
    it.
    """

    height: float
    weight: float

    def wrenches(self, memory, t, motion, rotor_speeds):
        place, link = motion.frame()
        depth = self.height + self.weight / 4000.0 - motion.position(place, link).z
        held = logical_and(t >= PICK, t < DROP)
        return (
            Wrench(
                force_W=Vec3(0.0, 0.0, where(held, maximum(4000.0 * depth, 0.0), 0.0)),
                point=place,
                body=link,
            ),
        )


def loads(seeds, seed):
    """An unknown load is picked up, lifted, carried, lowered and let go."""
    for name, (joints, largest, options, masses) in LOADS.items():
        plant, model, height, *_ = VEHICLES[name]
        ways = [
            {"start": LIFT, "segments": [[2.2, 0.3]]},
            {"start": DOWN, "segments": [[2.2, -0.3]]},
        ]
        path = [{"kind": "sequence", "shape": "quintic", **way} for way in ways]
        along = {
            "kind": "sequence",
            "shape": "quintic",
            "start": CARRY,
            "segments": [[2.2, 0.5]],
        }
        for mass in masses:
            document = {
                "schema": 1,
                "name": "carry",
                "duration": 11.0,
                "plant": {"vehicle": plant},
                "model": {"vehicle": model},
                "controller": {
                    "law": "centroidal",
                    "mode": "tip",
                    "load": largest,
                    **options,
                },
                "reference": {
                    "base": {"kind": "signals", "x": along, "z": [height, *path]},
                    "joints": joints,
                    "load": {
                        "kind": "windowed",
                        "signal": 1.0,
                        "start": PICK,
                        "stop": DROP,
                    },
                },
                "payloads": [
                    {"name": "load", "mass": mass, "pick": PICK, "drop": DROP}
                ],
                "sensors": NOISE,
                "delays": {"measurement": 0.005},
            }
            scenario = scenario_from(document)
            start = float(
                skyarm.run(dataclasses.replace(scenario, duration=0.1)).tip_reference[
                    0, 2
                ]
            )
            support = Support(height=start, weight=9.81 * mass)

            def read(log, mass=mass):
                error = 1e3 * np.linalg.norm(log.tip - log.tip_reference, axis=1)
                last, known = (
                    np.searchsorted(log.time, DROP) - 1,
                    np.searchsorted(log.time, LIFT + 1.1),
                )
                return {
                    "lift": error[(log.time >= LIFT) & (log.time < CARRY)].max(),
                    "before": error[last],
                    "after": error[log.time >= DROP].max(),
                    "mass": 100.0 * abs(log.load_mass_found[known] / mass - 1.0),
                }

            flown = dataclasses.replace(scenario, forces=(*scenario.forces, support))
            completed, found = singly(flown, seeds, seed, read)
            sizes = [
                cell
                for word in ("lift", "before", "after", "mass")
                for cell in mean_and_largest(found[word], 1)
            ]
            yield f"{name}, {1e3 * mass:g} g", completed, *sizes


def noisy_task(name):
    """A shipped scenario under the noise of all rows."""
    scenario = skyarm.load_scenario(name)
    delays = dataclasses.replace(scenario.delays, measurement=0.005)
    return dataclasses.replace(scenario, noise=SensorNoise(**NOISE), delays=delays)


def together(scenario, values, metrics, seeds, seed):
    """Flights of one scenario in one batch, every row of ``values`` (path -> numbers)
    in every seed.

    How many completed, and the sizes of their metrics.
    """
    count = max((len(column) for column in values.values()), default=1)
    lanes = {path: np.repeat(column, seeds) for path, column in values.items()}
    path = "plant.vehicle.base.mass"
    lanes = lanes or {path: np.full(seeds, float(number_at(scenario, path)))}
    flown = Batch(scenario, tuple(lanes), metrics=metrics).fly(
        lanes, seed=seed, episodes=np.tile(np.arange(seeds), count)
    )
    ended = np.asarray(flown.status) == "completed"
    found = {word: np.abs(column)[ended] for word, column in flown.metrics.items()}
    return f"{ended.sum()} of {count * seeds}", found


def handles(seeds, seed):
    """Door and valve by their handle, whose arc is believed 6 % too wide or too
    narrow.
    """
    for task, turns in (("pull_door", 60.0), ("turn_valve", 90.0)):
        scenario = noisy_task(task)
        off = {
            path: text for path, text in TASKS[task].numbers.items() if "hinge" in text
        }
        values = columns_of(off, scenario, {"hinge": np.array([-RADIUS, RADIUS])})

        metrics = ("grip_force_mean", "grip_force_max", "mechanism_furthest")
        completed, found = together(scenario, values, metrics, seeds, seed)
        sizes = [
            cell
            for metric in metrics[:2]
            for cell in mean_and_largest(found[metric], 2)
        ]
        turned = mean_and_largest(np.degrees(found[metrics[2]]), 1)[0]
        yield f"`{task}`, {turns:g} degrees", completed, *sizes, turned


PEGS = {
    "1.5 mm off (`examples/insert_a_peg.toml`)": "examples/insert_a_peg.toml",
    "3 mm off, with a search (`peg_in_hole`)": "peg_in_hole",
}
"""Scenarios: the tip is the middle of the peg's lower rim."""


def pegs(seeds, seed):
    """A peg 1.5 mm beside its hole, and 3 mm beside it with a search; in is 90 % of the
    hole's 30 mm.
    """
    for title, file in PEGS.items():
        scenario = noisy_task(file if "/" not in file else str(ROOT / file))
        surface = next(each for each in scenario.world.surfaces if each.shape == "hole")
        mouth = float(surface.position.z)

        _, found = together(
            scenario, {}, ("contact_largest", "tip_lowest"), seeds, seed
        )
        inserted = int((1e3 * (mouth - found["tip_lowest"]) > 27.0).sum())
        yield (
            title,
            f"{inserted} of {seeds}",
            *mean_and_largest(found["contact_largest"], 1),
        )


FLOWN = ("completed",)
TABLES = {
    "winds": (
        (
            "direction",
            "state",
            *FLOWN,
            "largest error, N",
            "largest of all",
            "contact lost",
        ),
        winds,
    ),
    "edges": (
        ("sensor", *FLOWN, "past the face, mm", "largest, mm", "contact lost before"),
        edges,
    ),
    "handles": (
        (
            "task",
            *FLOWN,
            "mean force, N",
            "worst mean",
            "peak force, N",
            "worst peak",
            "turned, degrees",
        ),
        handles,
    ),
    "pegs": (("case", "inserted", "largest force, N", "largest of all"), pegs),
    "loads": (
        (
            *(
                "case",
                *FLOWN,
                "in the lift, mm",
                "largest lift",
                "before the release, mm",
                "largest before",
            ),
            *("after it, mm", "largest after", "mass error, %", "largest mass error"),
        ),
        loads,
    ),
}

if __name__ == "__main__":
    print_part(__doc__, TABLES, seeds=20, seed=5)
