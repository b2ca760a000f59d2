"""Measure how well delays and lags are found: the table of docs/results_delays.md.

    python tests/studies/identify/measure_lags.py [--flights 10] [--seed 300]

Flies so many flights of 12 s of each of three vehicles, in wind and gusts: commands 0 to
30 ms late, motors 0.5 to 4 times as slow as believed, drives with 0 to 40 ms of lag, drawn by the seed. Prints of what
is found in the sensors' log the mean and the worst error, and how many truths lie within their 95 % interval.
"""

import argparse

import numpy as np
from planted_lags import numbers_of, planted, truths_of

import skyarm
from skyarm.studies.identify.loop_lags import loop_lags

VEHICLES = ("hummingbird_arm2_rotors", "crazyflie_arm1", "hexarotor_arm6")
ROWS = ("delay and lag together", "delay", "time constants", "time constants")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--flights", type=int, default=10)
    parser.add_argument("--seed", type=int, default=300)
    told = parser.parse_args()
    errors, within = {}, {}
    for vehicle in VEHICLES:
        believed = skyarm.load_vehicle(vehicle)
        for k in range(told.flights):
            draw = np.random.default_rng([told.seed, k])
            late, drive = 1e-3 * draw.integers(0, 31), 1e-3 * draw.integers(0, 41)
            slower = float(np.exp(draw.uniform(np.log(0.5), np.log(4.0))))
            log = planted(believed, 12.0, late, slower, drive, told.seed + k)
            if log.time[-1] < 11.9:
                print(f"{vehicle} {k}: lost at {log.time[-1]:.1f} s, {1e3 * late:.0f} ms late, motors x {slower:.2f}")
                continue
            found = loop_lags(log, believed)
            of_rotors, of_joints = truths_of(believed, late, slower, drive)
            lags = [("rotors", found.rotors, of_rotors), *(("joints", each, of_joints) for each in found.joints)]
            for part, lag, truths in lags:
                if not lag.is_known:
                    print(f"{vehicle} {k}: {part} not known")
                    continue
                for row, value, truth in zip(ROWS, numbers_of(lag), truths, strict=True):
                    if row == "time constants" and part == "joints":
                        continue
                    off = value.value - truth
                    errors.setdefault((part, row), []).append(off / truth if row == "time constants" else 1e3 * off)
                    within.setdefault((part, row), []).append(value.low <= truth <= value.high)
    print("| | error, mean (worst) | within the interval |\n|-|-|-|")
    for (part, row), each in errors.items():
        size, unit = (100.0 * np.abs(each), "%") if row == "time constants" else (np.abs(each), "ms")
        inside = within[part, row]
        print(f"| {part}: {row} | {size.mean():.1f} ({size.max():.1f}) {unit} | {sum(inside)} of {len(inside)} |")


if __name__ == "__main__":
    main()
