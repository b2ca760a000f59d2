"""Largest differences between the two plants over the paper's five experiments, as rows
of docs/data/the_paper.md.

python tests/website/plants_compared.py            print the table; a minute
python tests/website/plants_compared.py --small    one experiment under one integrator
"""

from __future__ import annotations

import dataclasses
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

# the tests' own modules, when this is run as a program
sys.path.append(str(Path(__file__).resolve().parents[1]))

import skyarm
from support.measured_tables import print_table

CASES = ("case1", "case2", "case3", "case2_gust", "case3_wind")
LAWS = ("paper_ct", "paper_pd")
INTEGRATORS = ("rk4", "rk4_staged", "euler")


def compared(
    integrator: str, cases: Sequence[str] = CASES
) -> tuple[float, float, float]:
    """Largest differences of base (m) and joints (rad) between the plants, and
    processor time of MuJoCo's, s.
    """
    base = joints = spent = 0.0
    for case in cases:
        for law in LAWS:
            logs = []
            for kind in ("rigid_body", "mujoco"):
                planned = skyarm.load_scenario(case, controller=law, plant=kind)
                begun = time.process_time()
                logs.append(
                    skyarm.run(dataclasses.replace(planned, integrator=integrator))
                )
                spent += time.process_time() - begun if kind == "mujoco" else 0.0
            base = max(base, float(np.abs(logs[0].position - logs[1].position).max()))
            joints = max(joints, float(np.abs(logs[0].joints - logs[1].joints).max()))
    return base, joints, spent


def row(integrator: str, base: float, joints: float) -> str:
    """Row of the page without the processor time."""
    cells = [
        "0 (rounding)" if each < 1e-9 else f"{1e3 * each:.1g}"
        for each in (base, joints)
    ]
    return f"| `{integrator}` | {cells[0]} | {cells[1]} |"


def rows(integrators: Sequence[str], cases: Sequence[str]) -> Iterator[list[str]]:
    """Rows of the page."""
    usual = 0.0
    for name in integrators:
        base, joints, spent = compared(name, cases)
        usual = usual or spent
        yield [
            *row(name, base, joints).strip("| ").split(" | "),
            f"{spent / usual:.1f}",
        ]


HEADS = (
    "integrator",
    "base, mm",
    "joints, mrad",
    "processor time of MuJoCo's plant over `rk4`",
)

if __name__ == "__main__":
    small = "--small" in sys.argv[1:]
    print_table(
        HEADS,
        rows(INTEGRATORS[:1] if small else INTEGRATORS, CASES[2:3] if small else CASES),
    )
