"""Measure the rows of contact tasks that a batch of pushes does not show: winds, edges, loads, handles, pegs.

    python tests/control/measure_tasks.py [SEEDS [SEED]]

``measure_pressing.py`` prints these rows behind its own. Noise is that of the rows there.
"""

import dataclasses
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from measure_pressing_scenes import NOISE, VEHICLES, scene_document

import skyarm
from skyarm.algebra import Vec3
from skyarm.algebra.scalars import logical_and, maximum, where
from skyarm.scenario.numbers import number_at
from skyarm.scenario.scenario_file import scenario_from
from skyarm.sensing.measurement import SensorNoise
from skyarm.simulate.batch import Batch
from skyarm.studies.compare.contact_tasks import RADIUS, TASKS
from skyarm.world.component import Force, Wrench

ROOT = Path(__file__).resolve().parents[2]

SIDES = {"into": (2.0, 0.0), "away": (-2.0, 0.0), "left": (0.0, 2.0), "right": (0.0, -2.0)}
"""Wind of 2 N along x and y, world axes: the wall stands ahead."""

EDGE = 1.42
"""m, height at which the wall ends; the tip begins 15 cm below."""

PICK, LIFT, CARRY, DOWN, DROP = 1.0, 1.5, 4.2, 6.9, 9.6
"""s, of a load: it is taken, lifted 0.3 m in 2.2 s, carried 0.5 m in 2.2 s, lowered, let go."""

LOADS = {  # posture, largest mass that is learned (kg), options of the law, masses (kg)
    "H": ([0.5, -1.0], 0.3, {}, (0.05, 0.1, 0.15)),
    "X": ([0.0, 0.6, -1.0, 0.0, 0.5, 0.0], 0.6, {"reach": 0.24, "damping": 0.06}, (0.3, 0.5)),
}


def row(title, flown, ended, count):
    """One line: mean and largest of each number over the flights that came to their end."""
    numbers = "; ".join(f"{word} {np.mean(x):.3f} ({np.max(x):.3f})" for word, x in flown.items() if len(x))
    print(f"{title}: {ended} of {count}; {numbers}", flush=True)


def singly(title, scenario, seeds, seed, read):
    """Flights one by one; ``read`` gives numbers of a log by their words."""
    logs = [skyarm.run(dataclasses.replace(scenario, seed=seed, episode=k)) for k in range(seeds)]
    whole = [log for log in logs if log.status == "completed"]
    found = [read(log) for log in whole]
    row(title, {word: [each[word] for each in found] for word in (found[0] if found else ())}, len(whole), len(logs))


def touched(log):
    """s, of the first touch."""
    return log.time[np.argmax(log.contact_force[:, 0] > 0.0)]


def winds(seeds, seed):
    """X holds 5 N, and wind comes and goes in steps: the largest error of the force from 2 s after the touch on."""
    for side, (x, y) in SIDES.items():
        for noisy in (False, True):
            document = scene_document("X", noisy=noisy)
            document["reference"]["push"]["force"]["value"] = 5.0
            gust = {"force": [x, y, 0.0], "start": 5.0, "duration": 2.5}
            document["environment"] = {"wind": {"mode": "force_wind", "gust": gust}}

            def read(log):
                force = log.contact_force[log.time > touched(log) + 2.0, 0]
                return {"largest error, N": np.abs(force - 5.0).max(), "lost": float((force <= 0.0).any())}

            told = "noisy" if noisy else "perfect"
            singly(f"wind 2 N {side}, X 5 N, {told}", scenario_from(document), seeds if noisy else 1, seed, read)


def edges(seeds, seed):
    """X slides up with 5 N beyond the end of the wall: how far the tip goes past its face in 0.3 s."""
    for sensor in (False, True):
        document = scene_document("X", slide=0.5)
        document["duration"] = 7.0
        document["reference"]["push"]["force"]["value"] = 5.0
        wall = document["world"]["surfaces"][0]
        wall["size"][2], wall["position"][2] = EDGE, 0.5 * EDGE
        if sensor:
            document["sensors"] |= {"wrist": {"kind": "force_torque", "force": {"sigma": 0.05}}}
            document["controller"]["force_sensor"] = True
        face = wall["position"][0] - 0.5 * wall["size"][0]

        def read(log, face=face):
            over = log.time[np.argmax(log.tip[:, 2] > EDGE)]
            before = log.contact_force[(log.time > touched(log) + 0.3) & (log.time < over), 0]
            after = (log.time >= over) & (log.time <= over + 0.3)
            return {"past, mm": 1e3 * (log.tip[after, 0] - face).max(), "lost before": float((before <= 0.0).sum())}

        singly(
            f"wall ends, X 5 N, {'with' if sensor else 'without'} sensor", scenario_from(document), seeds, seed, read
        )


@dataclass(frozen=True, kw_only=True)
class Support(Force):
    """A spring under the tip that bears a load where it was taken, until the tip lifts it."""

    height: float
    weight: float

    def wrenches(self, memory, t, motion, rotor_speeds):
        place, link = motion.frame()
        depth = self.height + self.weight / 4000.0 - motion.position(place, link).z
        held = logical_and(t >= PICK, t < DROP)
        return (Wrench(force_W=Vec3(0.0, 0.0, where(held, maximum(4000.0 * depth, 0.0), 0.0)), point=place, body=link),)


def loads(seeds, seed):
    """An unknown load is picked up, lifted, carried, lowered and let go."""
    for name, (joints, largest, options, masses) in LOADS.items():
        plant, model, height, *_ = VEHICLES[name]
        ways = [{"start": LIFT, "segments": [[2.2, 0.3]]}, {"start": DOWN, "segments": [[2.2, -0.3]]}]
        path = [{"kind": "sequence", "shape": "quintic", **way} for way in ways]
        along = {"kind": "sequence", "shape": "quintic", "start": CARRY, "segments": [[2.2, 0.5]]}
        for mass in masses:
            document = {
                "schema": 1, "name": "carry", "duration": 11.0,
                "plant": {"vehicle": plant}, "model": {"vehicle": model},
                "controller": {"law": "centroidal", "mode": "tip", "load": largest, **options},
                "reference": {
                    "base": {"kind": "signals", "x": along, "z": [height, *path]}, "joints": joints,
                    "load": {"kind": "windowed", "signal": 1.0, "start": PICK, "stop": DROP},
                },
                "payloads": [{"name": "load", "mass": mass, "pick": PICK, "drop": DROP}],
                "sensors": NOISE, "delays": {"measurement": 0.005},
            }  # fmt: skip
            scenario = scenario_from(document)
            start = float(skyarm.run(dataclasses.replace(scenario, duration=0.1)).tip_reference[0, 2])
            support = Support(height=start, weight=9.81 * mass)

            def read(log, mass=mass):
                error = 1e3 * np.linalg.norm(log.tip - log.tip_reference, axis=1)
                last, known = np.searchsorted(log.time, DROP) - 1, np.searchsorted(log.time, LIFT + 1.1)
                return {
                    "sag, mm": error[(log.time >= LIFT) & (log.time < CARRY)].max(),
                    "release, mm": error[log.time >= DROP].max(), "place, mm": error[last],
                    "mass, %": 100.0 * abs(log.load_mass_found[known] / mass - 1.0),
                }  # fmt: skip

            flown = dataclasses.replace(scenario, forces=(*scenario.forces, support))
            singly(f"load, {name} {1e3 * mass:g} g, noisy", flown, seeds, seed, read)


def noisy_task(name):
    """A shipped scenario under the noise of all rows."""
    scenario = skyarm.load_scenario(name)
    delays = dataclasses.replace(scenario.delays, measurement=0.005)
    return dataclasses.replace(scenario, noise=SensorNoise(**NOISE), delays=delays)


def together(title, scenario, values, metrics, seeds, seed, read):
    """Flights of one scenario, all in one batch: every row of ``values`` (path -> numbers) in every seed."""
    count = max((len(column) for column in values.values()), default=1)
    lanes = {path: np.repeat(column, seeds) for path, column in values.items()}
    path = "plant.vehicle.base.mass"
    lanes = lanes or {path: np.full(seeds, float(number_at(scenario, path)))}
    flown = Batch(scenario, tuple(lanes), metrics=metrics).fly(
        lanes, seed=seed, episodes=np.tile(np.arange(seeds), count)
    )
    ended = np.asarray(flown.status) == "completed"
    found = {word: np.abs(column)[ended] for word, column in read(flown.metrics).items()}
    row(title, found, int(ended.sum()), count * seeds)


def handles(seeds, seed):
    """Door and valve by their handle, whose arc is believed 6 % too wide or too narrow."""
    for task, turns in (("pull_door", 60.0), ("turn_valve", 90.0)):
        scenario, (name, *way) = noisy_task(task), TASKS[task].hinge
        paths = {f"world.{name}.position.{i}": length for i, length in enumerate(way) if length}
        wrong = np.array([-RADIUS, RADIUS])
        values = {path: number_at(scenario, path) + wrong * length for path, length in paths.items()}

        def read(found):
            force, largest, behind = (found[f"grip_{word}"] for word in ("force_mean", "force_max", "lag_max"))
            turned = np.degrees(found["mechanism_furthest"])
            return {"radial, N": force, "largest, N": largest, "lag, deg": np.degrees(behind), "turned, deg": turned}

        metrics = ("grip_force_mean", "grip_force_max", "grip_lag_max", "mechanism_furthest")
        together(f"{task} {turns:g} deg, radius 6 % wrong, noisy", scenario, values, metrics, seeds, seed, read)


PEGS = {"1.5 mm off": "examples/insert_a_peg.toml", "3 mm off, search": "peg_in_hole"}
"""Scenarios: the tip is the middle of the peg's lower rim."""


def pegs(seeds, seed):
    """A peg 1.5 mm beside its hole, and 3 mm beside it with a search; in is 90 % of the hole's 30 mm."""
    for title, file in PEGS.items():
        scenario = noisy_task(file if "/" not in file else str(ROOT / file))
        surface = next(each for each in scenario.world.surfaces if each.shape == "hole")
        mouth = float(surface.position.z)

        def read(found, mouth=mouth):
            deep = 1e3 * (mouth - found["tip_lowest"])
            return {"peak, N": found["contact_largest"], "depth, mm": deep, "in": (deep > 27.0).astype(float)}

        metrics = ("contact_largest", "tip_lowest")
        together(f"peg {title}, noisy", scenario, {}, metrics, seeds, seed, read)


def measure(seeds, seed):
    """All rows."""
    for part in (pegs, handles, winds, edges, loads):
        part(seeds, seed)


if __name__ == "__main__":
    measure(*(int(word) for word in [*sys.argv[1:], *("20", "5")[len(sys.argv) - 1 :]]))
