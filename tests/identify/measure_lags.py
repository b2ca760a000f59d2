"""Measure how well delays and lags are found: a table of
docs/data/results_identification.md.

    python tests/identify/measure_lags.py [--flights 10] [--seed 300] [--small]

Flies so many flights of 12 s of each of three vehicles, in wind and gusts: commands 0
to 30 ms late, motors 0.5 to 4 times as slow as believed, drives with 0 to 40 ms of lag,
drawn by the seed. Prints of what is found in the sensors' log the mean and the worst
error, and how many truths lie within their 95 % interval; flights that were lost are
named on the standard error.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

# the tests' own modules, when this is run as a program
sys.path.append(str(Path(__file__).parents[1]))

from planted_lags import numbers_of, planted, truths_of

import skyarm
from skyarm.identify.loop_lags import loop_lags
from support.measured_tables import print_table, progress

VEHICLES = ("hummingbird_arm2_rotors", "crazyflie_arm1", "hexarotor_arm6")
ROWS = ("delay and lag together", "delay", "time constants", "time constants")


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--flights", type=int, default=10)
    parser.add_argument("--seed", type=int, default=300)
    parser.add_argument(
        "--small", action="store_true", help="one flight of one vehicle: seconds"
    )
    told = parser.parse_args()
    if told.small:
        told.flights = 1
    errors, within = {}, {}
    for vehicle in VEHICLES[:1] if told.small else VEHICLES:
        believed = skyarm.load_vehicle(vehicle)
        for k in range(told.flights):
            draw = np.random.default_rng([told.seed, k])
            late, drive = 1e-3 * draw.integers(0, 31), 1e-3 * draw.integers(0, 41)
            slower = float(np.exp(draw.uniform(np.log(0.5), np.log(4.0))))
            log = planted(believed, 12.0, late, slower, drive, told.seed + k)
            if log.time[-1] < 11.9:
                progress(
                    f"{vehicle} {k}: lost at {log.time[-1]:.1f} s, {1e3 * late:.0f} ms"
                    f" late, motors x {slower:.2f}"
                )
                continue
            found = loop_lags(log, believed)
            of_rotors, of_joints = truths_of(believed, late, slower, drive)
            lags = [
                ("rotors", found.rotors, of_rotors),
                *(("joints", each, of_joints) for each in found.joints),
            ]
            for part, lag, truths in lags:
                if not lag.is_known:
                    progress(f"{vehicle} {k}: {part} not known")
                    continue
                for row, value, truth in zip(
                    ROWS, numbers_of(lag), truths, strict=True
                ):
                    if row == "time constants" and part == "joints":
                        continue
                    off = value.value - truth
                    errors.setdefault((part, row), []).append(
                        off / truth if row == "time constants" else 1e3 * off
                    )
                    within.setdefault((part, row), []).append(
                        value.low <= truth <= value.high
                    )
    heads = (
        "found",
        ">mean error",
        ">worst error",
        "unit",
        ">true values inside the 95 % interval",
    )
    print_table(
        heads,
        (
            line(part, row, each, within[part, row])
            for (part, row), each in errors.items()
        ),
    )


def line(part, row, errors, inside):
    """Cells of one kind of number: errors in ms, or relative ones of time constants in
    %.
    """
    size, unit = (
        (100.0 * np.abs(errors), "%")
        if row == "time constants"
        else (np.abs(errors), "ms")
    )
    return (
        f"{part}: {row}",
        f"{size.mean():.1f}",
        f"{size.max():.1f}",
        unit,
        f"{sum(inside)} of {len(inside)}",
    )


if __name__ == "__main__":
    main()
