"""Largest differences between the two plants over the paper's five experiments, as rows of docs/the_paper.md.

python tests/website/plants_compared.py            print the rows; a minute
"""

from __future__ import annotations

import dataclasses
import time

import numpy as np

import skyarm

CASES = ("case1", "case2", "case3", "case2_gust", "case3_wind")
LAWS = ("paper_ct", "paper_pd")
INTEGRATORS = ("rk4", "rk4_staged", "euler")


def compared(integrator: str) -> tuple[float, float, float]:
    """Largest differences of base (m) and joints (rad) between the plants, and processor time of MuJoCo's, s."""
    base = joints = spent = 0.0
    for case in CASES:
        for law in LAWS:
            logs = []
            for kind in ("rigid_body", "mujoco"):
                planned = skyarm.load_scenario(case, controller=law, plant=kind)
                begun = time.process_time()
                logs.append(skyarm.run(dataclasses.replace(planned, integrator=integrator)))
                spent += time.process_time() - begun if kind == "mujoco" else 0.0
            base = max(base, float(np.abs(logs[0].position - logs[1].position).max()))
            joints = max(joints, float(np.abs(logs[0].joints - logs[1].joints).max()))
    return base, joints, spent


def row(integrator: str, base: float, joints: float) -> str:
    """Row of the page without the processor time."""
    cells = ["0 (rounding)" if each < 1e-9 else f"{1e3 * each:.1g}" for each in (base, joints)]
    return f"| `{integrator}` | {cells[0]} | {cells[1]} |"


if __name__ == "__main__":
    usual = 0.0
    for name in INTEGRATORS:
        found = compared(name)
        usual = usual or found[2]
        print(row(name, *found[:2])[:-1] + f"| {found[2] / usual:.1f} |")
