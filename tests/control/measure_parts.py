"""Measure what parts are worth: the table of docs/data/results_laws.md, of the law as
it is and without one of them.

    python tests/control/measure_parts.py [--row TRIAL[:VALUE]] [--law NAME]
        [--vehicle NAME] [--seed 400] [--seeds 4] [--small]

Prints of each trial of the envelope, at each value, the mean error of the tip (mm) over
the seeds by every law of ``LAWS``, or "lost" with the count of flights that ended
early. Sensors of a noisy trial add 0.05 m/s^2 of noise to each specific force. ``--row
turbulence`` prints the deviation of the sideways force per mass, too (m/s^2): what the
least errors of ``least_tip_error.py`` are computed with.
"""

import argparse
import dataclasses
import sys
from pathlib import Path

import numpy as np

# the tests' own modules, when run as a program
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from skyarm.control.catalogue import make_controller
from skyarm.log.metrics.windows import Window, Windows
from skyarm.simulate.batch import Batch
from skyarm.studies.compare.envelope_axes import AXES, TIP
from skyarm.studies.trial.facts import PAPER, setting_of
from skyarm.studies.trial.trial import NOISE
from support.measured_tables import print_row, print_table, progress

HEARD = dataclasses.replace(NOISE, specific_force=0.05)
LAWS = {
    "usual": {},
    "velocities": {"accelerometer": (0.0, 0.0)},
    "calm": {"bandwidth": 0.7},
    "without lag": {"lag": (0.0, 0.0)},
    "without preview": {"preview": 0.0},
    "without trend": {"force_trend": 0.0},
}
HEADS = {
    "usual": "all parts",
    "velocities": "no accelerometer",
    "calm": "`bandwidth = 0.7`",
    "without lag": "no `lag`",
    "without preview": "no `preview`",
    "without trend": "no `force_trend`",
}
ROWS = {
    "noise": {1.0: "noise of the comparison"},
    "turbulence": {3.0: "turbulence, 3 m/s", 6.0: "turbulence, 6 m/s"},
    "turning_wind": {20.0: "wind that turns in 20 s", 5.0: "wind that turns in 5 s"},
    "wind_steps": {3.0: "wind steps, 3 N", 5.0: "wind steps, 5 N"},
    "push_x": {1.0: "push on the tip along x, 1 N"},
    "push_y": {1.0: "push on the tip along y, 1 N"},
    "push_z": {3.0: "push on the tip from below, 3 N"},
    "circle": {1.0: "circle, 1 m/s", 3.0: "circle, 3 m/s"},
    "vertical_noisy": {1.0: "vertical 1 Hz, noisy"},
    "swing": {2.0: "joints swing at 2 Hz"},
    "payload": {0.2: "unknown payload of 0.2 kg"},
    "command_delay": {0.02: "commands 20 ms late"},
    "motor_lag": {4.0: "motors four times slower"},
    "joint_lag": {0.04: "joints 40 ms late"},
}
"""Trial of the envelope -> its values, and their titles in the page."""


def trial(name, value, law, vehicle, log=0):
    """A batch of one trial, and the values that its paths take."""
    axis, setting = AXES[name], setting_of(vehicle)
    built = axis.scenario(setting, value)
    if axis.noisy:
        built = dataclasses.replace(built, noise=HEARD)
    told = {"mode": "tip", "delay": built.delays.measurement, **LAWS[law]}
    built = dataclasses.replace(
        built,
        controller=make_controller("centroidal", built.controller.par.model, **told),
    )
    numbers = axis.numbers_of(setting, value)
    inside = Window(axis.start, built.duration)
    windows = Windows(steady=inside, gust=inside, last=built.duration - axis.start)
    metrics = ("standard", TIP)
    return (
        Batch(
            built,
            tuple(numbers),
            metrics=metrics,
            windows=windows,
            effort=0,
            log_every=log,
        ),
        numbers,
    )


def fly(name, value, law, vehicle, seeds, log=0):
    """Fly one trial, a lane a seed; a trial without any noise has one lane."""
    batch, numbers = trial(name, value, law, vehicle, log)
    lanes = seeds if AXES[name].noisy or name == "turbulence" else seeds[:1]
    values = {path: np.full(len(lanes), number) for path, number in numbers.items()}
    return batch.fly(values, seed=0, episodes=np.array(lanes))


def error(name, flown):
    """Mean error over the lanes, mm, or how many were lost."""
    lost = int((np.asarray(flown.status) != "completed").sum())
    return f"lost {lost}" if lost else f"{1e3 * flown.metrics[TIP].mean():.3g}"


def sideways_force(flown, start=4.0):
    """Standard deviation of the force per mass along y, m/s^2: what moves the centre of
    mass beside the thrust.
    """
    truth, log, state = setting_of(PAPER).truth, flown.log, flown.log.state
    dt = log.time[1] - log.time[0]
    # of the hanging arm; what the planar arm moves of it along y is nothing
    height = centre_height(truth)
    up = state.quaternion.rotation().column(2)
    y = np.asarray(state.position.y) + height * np.asarray(up.y)
    thrust = sum(
        float(r.thrust_coefficient) * w**2
        for r, w in zip(truth.rotors, state.rotor_speeds, strict=True)
    )
    pushed = np.gradient(np.gradient(y, dt, axis=1), dt, axis=1) - np.asarray(
        up.y
    ) * thrust / float(truth.mass)
    return float(np.sqrt((pushed[:, log.time >= start] ** 2).mean()))


def centre_height(vehicle):
    """Height of the centre of mass of the hanging arm and vehicle against the base
    origin, m.
    """
    from skyarm.algebra import Mat3
    from skyarm.dynamics import mass_matrix

    M = mass_matrix(vehicle, Mat3.identity(), (0.0,) * vehicle.n)
    return float(M[0][4]) / float(vehicle.mass)


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--row", help="one trial, or one value of it: push_x:3")
    parser.add_argument("--law", choices=LAWS)
    parser.add_argument("--vehicle", default=PAPER)
    parser.add_argument("--seed", type=int, default=400)
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument(
        "--small", action="store_true", help="one row, one seed: seconds"
    )
    asked = parser.parse_args()
    laws = [asked.law] if asked.law else list(LAWS)
    seeds = list(range(asked.seed, asked.seed + (1 if asked.small else asked.seeds)))
    only, _, single = (asked.row or ("noise" if asked.small else "")).partition(":")
    print_table(["trial", *(f">{HEADS[law]}" for law in laws)])
    for name, values in ROWS.items():
        if only not in ("", name):
            continue
        for value, title in (
            {float(single): f"{name} {single}"} if single else values
        ).items():
            found = [
                error(name, fly(name, value, law, asked.vehicle, seeds)) for law in laws
            ]
            print_row([title, *found])
            if name == "turbulence" and only and asked.vehicle == PAPER:
                flown = fly(name, value, "usual", PAPER, seeds, log=1)
                progress(f"sideways force per mass {sideways_force(flown):.3f} m/s^2")


if __name__ == "__main__":
    main()
