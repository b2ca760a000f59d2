"""Measure how well the centroidal law presses: the rows of docs/pressing.md, a batch each.

    python tests/control/measure_pressing.py [SEEDS [SEED]]

Prints of each row of pushes how many flights came to their end, the force's error and ripple, contacts lost after 0.3
s, the tip's error across the normal (mean and largest over the flights each), and the peak over max(force, v sqrt(k
m_tip)); then the rows of ``measure_tasks.py``: winds, edges, loads, handles, pegs.
"""

import sys

import numpy as np
from measure_pressing_scenes import VEHICLES, scene
from measure_tasks import measure

import skyarm
from skyarm.simulate.batch import Batch

FORCE, SPEED = "reference.push.force.value", "reference.push.speed"


def fly(title, name, rows, seeds, seed, **about):
    """Every row in every seed, all in one batch."""
    scenario = scene(name, **about)
    count = seeds if about.get("noisy", True) else 1
    paths = tuple(dict.fromkeys(path for row in rows for path in row))
    values = {path: np.repeat([row[path] for row in rows], count) for path in paths}
    batch = Batch(scenario, paths, metrics=("contact", "standard"), effort=0 if len(rows) * count < 40 else 2)
    flown = batch.fly(values, seed=seed, episodes=np.tile(np.arange(count), len(rows)))
    for k, row in enumerate(rows):
        lanes = slice(k * count, (k + 1) * count)
        size = {key: np.abs(column[lanes]) for key, column in flown.metrics.items()}
        floor = max(row[FORCE], row.get(SPEED, 0.1) * np.sqrt(5000.0 * VEHICLES[name][5]))
        shown = {"error, N": size["contact_error_mean"], "ripple, N": size["contact_ripple"],
                 "tip, mm": 1e3 * size["contact_tip_mean"], "peak": size["contact_peak"] / floor}  # fmt: skip
        ended = int((np.asarray(flown.status)[lanes] == "completed").sum())
        numbers = "; ".join(f"{word} {x.mean():.3f} ({x.max():.3f})" for word, x in shown.items())
        told = f"{row[FORCE]:g} N, {row.get(SPEED, 0.1):g} m/s, {'noisy' if count == seeds else 'perfect'}"
        print(
            f"{title} {name} {told}: {ended} of {count}; {numbers}; lost {size['contact_losses'].sum():.0f}", flush=True
        )


seeds, seed = (int(word) for word in [*sys.argv[1:], *("20", "5")[len(sys.argv) - 1 :]])
rotors = skyarm.load_vehicle("hexarotor_arm6").rotors
weak = {f"plant.vehicle.rotors.{i}.thrust_coefficient": 0.9 * float(r.thrust_coefficient) for i, r in enumerate(rotors)}
turn = np.radians(10.0)
WRONG = {
    "left": (np.sin(turn), 0.0),
    "right": (-np.sin(turn), 0.0),
    "up": (0.0, np.sin(turn)),
    "down": (0.0, -np.sin(turn)),
}
for noisy in (False, True):
    fly("hold", "H", [{FORCE: 1.0}, {FORCE: 2.0}], seeds, seed, noisy=noisy)
fly("hold, thrust -10 %,", "X", [{FORCE: force, **weak} for force in (2.0, 5.0, 10.0)], seeds, seed)
for name, forces in (("H", (1.0, 2.0)), ("X", (2.0, 5.0, 10.0))):
    hits = [{FORCE: force, SPEED: speed} for force in forces for speed in (0.1, 0.2, 0.3, 0.5)]
    fly("impact", name, hits, seeds, seed, ahead=0.24, duration=7.0)
for noisy in (False, True):
    fly("slide", "H", [{FORCE: 1.0}], seeds, seed, noisy=noisy, slide=0.5)
fly("slide, friction 0.6,", "X", [{FORCE: 5.0}], seeds, seed, friction=0.6, slide=0.5)
for side, (y, z) in WRONG.items():
    told = (-np.cos(turn), y, z)
    fly(f"normal 10 deg {side},", "X", [{FORCE: 5.0}], seeds, seed, slide=0.3, normal=told)
measure(seeds, seed)
