"""Measure what rotors that tilt are worth: the table *Tilting rotors* of
docs/data/results_laws.md.

    python tests/control/measure_tilting.py [--small]

Errors of the tip and tilt of the base from 1 s on. Noise and delay are those of the
comparison.
"""

import dataclasses
import sys
from pathlib import Path

# the tests' own modules, when run as a program
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tilting_flights import (
    NOISE,
    SWINGING,
    VOLIRO,
    across,
    eased_circle,
    errors,
    scenario,
    tilt,
)

from skyarm.simulate import run
from support.measured_tables import print_part

TRIALS = {
    "1 m in 3 s": (across(3.0, SWINGING, 1.0), 5.0),
    "circle of 1 m, 1 m/s": (eased_circle(1.0), 12.0),
}
FLOWN = {
    "without `sideways`": {"sideways": 0.0},
    "with `sideways`": {},
    "noisy": {"delay": 0.005},
}


def trials(_, seed):
    """A flight a row."""
    for trial, (motion, seconds) in TRIALS.items():
        for flown, options in FLOWN.items():
            planned = scenario(VOLIRO, motion, seconds, **options)
            if flown == "noisy":
                planned = dataclasses.replace(planned, noise=NOISE, seed=seed)
            log = run(planned)
            late = log.time >= 1.0
            error = errors(log, "tip")[late]
            yield (
                trial,
                flown,
                f"{error.mean():.2f}",
                f"{error.max():.2f}",
                f"{tilt(log)[late].max():.1f}",
            )


HEADS = (
    "trial",
    "flown",
    ">mean tip error, mm",
    ">largest tip error, mm",
    ">largest tilt, degrees",
)

if __name__ == "__main__":
    print_part(__doc__, {"trials": (HEADS, trials)}, seeds=1, seed=0)
