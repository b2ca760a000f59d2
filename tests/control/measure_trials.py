"""Measure the centroidal law of this tree beside that of an earlier one, in the same
run, on MuJoCo's plant.

    git worktree add ../before 2806b03d
    python tests/control/measure_trials.py ../before/src [--rows PATTERN] [--seeds 8]
        [--seed 700]

Prints of each trial the mean error of the tip (mm, over time and seeds), the jitter
(mean change of a rotor's command in one control period, rad/s) and how many flights
were lost, by either law, and the ratio of both: over 1.05 is worse. Ends with the
geometric mean of the ratios of each group, and with exit code 1 if a trial is worse.

All trials are those of the envelope (:mod:`skyarm.studies.compare.envelope_axes`) with
the noise of the comparison's bench, 0.05 m/s^2 of noise in the specific force, and a
measurement that is 5 ms old, a delay that the law knows. A law is tuned on none of the
motions that a release reports.
"""

import argparse
import dataclasses
import json
import math
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np

LAW, PERIOD, SPECIFIC_FORCE = "centroidal_tip", 0.005, 0.05
WORSE = 1.05
"""Ratio beyond which a trial is worse: a tenth of the seeds' own spread on most
rows."""

VEHICLES = (
    "crazyflie_arm1",
    "hexarotor12_arm5",
    "hexarotor_arm6",
    "octo_coaxial_two_arms",
    "pelican_arm2",
    "quadrotor_roll_arm2",
    "voliro_like",
)
CONDITIONS = (
    ("noise", 1.0),
    ("circle", 1.5),
    ("swing", 1.0),
    ("turbulence", 4.5),
    ("turning_wind", 10.0),
    ("wind_steps", 3.0),
    ("command_delay", 0.02),
)
PLANTS, PLANT_SEED = 48, 11
TURN = 0.5 * math.pi
"""rad/s, of a vehicle that yaws on its circle."""


@dataclasses.dataclass(frozen=True)
class Trial:
    """One row: an axis of the envelope at a value, on a vehicle."""

    axis: str
    value: float
    vehicle: str = ""
    late: float = 0.0
    times: float = 1.0
    yaws: bool = False
    plant: int = -1

    @property
    def name(self) -> str:
        more = {
            "late": f"{1e3 * self.late:g} ms late" if self.late else "",
            "yaw": "yawing" if self.yaws else "",
        }
        noise = f"noise x {self.times:g}" if self.times != 1.0 else ""
        which = f"plant {self.plant}" if self.plant >= 0 else ""
        return " ".join(
            filter(
                None,
                (
                    self.vehicle,
                    self.axis,
                    f"{self.value:g}",
                    *more.values(),
                    noise,
                    which,
                ),
            )
        )


PAPER = (
    Trial("noise", 1.0),
    Trial("noise", 1.0, times=10.0),
    Trial("turbulence", 3.0),
    Trial("turbulence", 6.0),
    Trial("turning_wind", 20.0),
    Trial("turning_wind", 5.0),
    Trial("wind_steps", 5.0),
    Trial("wind_steps", 5.0, late=0.03),
    Trial("circle", 3.0),
    Trial("vertical", 1.0),
    Trial("circle", 1.0, yaws=True),
    Trial("swing", 2.0),
    Trial("push_x", 1.5),
    Trial("push_y", 1.5),
    Trial("push_z", 1.5),
    Trial("noise", 1.0, late=0.04),
    Trial("delay_in_flight", 0.04),
    Trial("motor_lag", 4.0),
    Trial("joint_lag", 0.04),
    Trial("payload", 0.1),
)
GROUPS = {
    "paper": PAPER,
    "vehicles": tuple(
        Trial(axis, value, vehicle)
        for vehicle in VEHICLES
        for axis, value in CONDITIONS
    ),
    "plants": tuple(Trial("wrong_plants", 1.0, plant=i) for i in range(PLANTS)),
}


def scenario_of(trial):
    """Scenario of a trial, and from when on it is judged, s; runs in the tree that
    flies it.
    """
    from skyarm.reference import Ramp
    from skyarm.scenario.controller_table import under_law
    from skyarm.scenario.numbers import with_numbers
    from skyarm.studies.compare import envelope_axes as axes
    from skyarm.studies.trial import facts as envelope_setting
    from skyarm.studies.trial.trial import NOISE

    axis = axes.AXES[trial.axis]
    setting = envelope_setting.setting_of(
        trial.vehicle or envelope_setting.PAPER, plant="mujoco"
    )
    built = axis.scenario(setting, trial.value * axis.share(setting))
    delays = dataclasses.replace(
        built.delays, measurement=PERIOD, command=trial.late or built.delays.command
    )
    noise = {
        field.name: trial.times * getattr(NOISE, field.name)
        for field in dataclasses.fields(NOISE)
    }
    built = dataclasses.replace(
        built,
        noise=dataclasses.replace(
            NOISE, **noise | {"specific_force": trial.times * SPECIFIC_FORCE}
        ),
        delays=delays,
    )
    if trial.yaws:
        turn = Ramp(start=2.0, duration=18.0, height=18.0 * TURN)
        built = dataclasses.replace(
            built, reference=dataclasses.replace(built.reference, yaw=turn)
        )
    if trial.plant >= 0:
        drawn = axes.plants_at(setting, built, trial.value, PLANTS, seed=PLANT_SEED)
        numbers = {path: float(values[trial.plant]) for path, values in drawn.items()}
        # MuJoCo's plant moves by whole steps
        numbers["delays.command"] = round(numbers["delays.command"], 3)
        built = with_numbers(built, numbers)
    return under_law(built, LAW), axis.start


def fly(trial, seeds):
    """Tip's mean error (mm), jitter (rad/s), and whether the flight was lost, by
    seed.
    """
    import skyarm

    scenario, start = scenario_of(trial)
    found = []
    for seed in seeds:
        log = skyarm.run(dataclasses.replace(scenario, seed=seed))
        at = log.time >= start
        error = 1e3 * np.linalg.norm(log.tip - log.tip_reference, axis=1)[at]
        jitter = np.abs(np.diff(log.rotor_commands[at], axis=0))
        lost = log.status != "completed"
        found.append(
            [float(error.mean()) if at.any() else math.nan, float(jitter.mean()), lost]
        )
    return found


def serve():
    """Fly the trials that come line by line."""
    for line in sys.stdin:
        told = json.loads(line)
        print(json.dumps(fly(Trial(**told["trial"]), told["seeds"])), flush=True)


class Tree:
    """Process in which a tree's law flies."""

    def __init__(self, source):
        told = os.environ | {"PYTHONPATH": str(source), "OPENBLAS_NUM_THREADS": "1"}
        self.process = subprocess.Popen(
            [sys.executable, __file__, "--serve"],
            env=told,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def ask(self, trial, seeds):
        """Begin one row."""
        told = {"trial": dataclasses.asdict(trial), "seeds": seeds}
        self.process.stdin.write(json.dumps(told) + "\n")
        self.process.stdin.flush()

    def answer(self):
        """Mean error, jitter and flights that were lost of the row that was begun; an
        error of the tree ends all.
        """
        line = self.process.stdout.readline()
        if not line:
            sys.exit("a tree could not fly the trial: see above")
        flown = json.loads(line)
        whole = [row for row in flown if not row[2]]
        error, jitter = (
            float(np.mean([row[k] for row in whole])) if whole else math.nan
            for k in (0, 1)
        )
        return error, jitter, len(flown) - len(whole)


def measure(trees, trials, seeds, group):
    """Print a group's rows; how many are worse, and the ratios."""
    worse, ratios = 0, []
    for trial in trials:
        for tree in trees:
            tree.ask(trial, seeds if trial.plant < 0 else seeds[:1])
        (old, shaken, gone), (new, shakes, lost) = (tree.answer() for tree in trees)
        ratio, jitter = new / old, shakes / shaken
        bad = lost > gone or ratio > WORSE or jitter > WORSE
        worse += bad
        ratios += [(ratio, jitter)] if math.isfinite(ratio) else []
        print(
            f"| {trial.name} | {old:.3g}, {shaken:.3g}, {gone} | {new:.3g},"
            f" {shakes:.3g}, {lost} | {ratio:.3f}, {jitter:.3f}"
            f" |{' worse' if bad else ''}",
            flush=True,
        )
    if ratios:
        error, jitter = np.exp(np.log(ratios).mean(axis=0))
        print(
            f"{group}: {len(trials)} trials, {worse} worse; mean ratio {error:.3f}, of"
            f" the jitter {jitter:.3f}"
        )
    return worse


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("source", nargs="?", help="source folder of the earlier tree")
    parser.add_argument(
        "--rows", default="", help="regular expression; of a group's name or a trial's"
    )
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--seed", type=int, default=700)
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    told = parser.parse_args()
    if told.serve:
        serve()
        return
    if not told.source or not (Path(told.source) / "skyarm").is_dir():
        parser.error(f"source = {told.source!r}: must be a folder that holds skyarm")
    trees = [Tree(Path(told.source).resolve()), Tree(Path(__file__).parents[2] / "src")]
    seeds, pattern = (
        list(range(told.seed, told.seed + told.seeds)),
        re.compile(told.rows),
    )
    print(
        "| trial | before: mm, rad/s, lost | now | ratios |\n| --- | --- | --- | --- |"
    )
    chosen = {
        group: [
            each
            for each in trials
            if pattern.search(group) or pattern.search(each.name)
        ]
        for group, trials in GROUPS.items()
    }
    sys.exit(
        min(
            sum(
                measure(trees, trials, seeds, group)
                for group, trials in chosen.items()
                if trials
            ),
            1,
        )
    )


if __name__ == "__main__":
    main()
