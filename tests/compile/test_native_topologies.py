"""Arms of any shape, masses of any size: machine code compiles and flies them, and the
process lives.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from skyarm.compile.llvm import kernel as native

PROGRAM = """
import dataclasses, sys
import numpy as np
from skyarm.algebra import Force, Vec3
from skyarm.records.leaves import leaves
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing.program import trace_loop
from skyarm.compile.llvm.kernel import Kernel, host_width
from skyarm.dynamics import forward_dynamics
from support.vehicles import random_vehicle

def factors(vehicle, values):
    scaled = []
    for link, factor in zip(vehicle.links, values[1:], strict=True):
        mass, inertia = link.body.mass * factor, link.body.inertia * factor
        body = dataclasses.replace(link.body, mass=mass, inertia=inertia)
        scaled.append(dataclasses.replace(link, body=body))
    base = dataclasses.replace(vehicle.base, mass=vehicle.base.mass * values[0])
    return dataclasses.replace(vehicle, base=base, links=tuple(scaled))

for number in range(int(sys.argv[1])):
    rng = np.random.default_rng([90, number])
    n = number % 7
    vehicle = random_vehicle(rng, n)

    def step(carry, values, row, draws):
        rate, joints, joint_rates = carry
        force = Force(Vec3(*row[:3]), Vec3(*row[3:]))
        scaled, still = factors(vehicle, values), (0.0,) * n
        base, qdd = forward_dynamics(scaled, joints, rate, joint_rates, force, still)
        qd = tuple(v + 1e-3 * a for v, a in zip(joint_rates, qdd, strict=True))
        q = tuple(x + 1e-3 * v for x, v in zip(joints, qd, strict=True))
        return (rate + base.angular * 1e-3, q, qd), ()

    carry = (Vec3(0.0, 0.0, 0.0), (0.0,) * n, (0.0,) * n)
    loop = trace_loop(step, carry, (1.0,) * (n + 1), (0.0,) * 6)
    lanes = 500
    values = 10.0 ** rng.uniform(-1.0, 1.0, (n + 1, lanes))
    odd = [0.0, -1.0, 1e300, np.nan, np.inf, 5e-324]
    values[:, ::50] = rng.choice(odd, (n + 1, lanes // 50))
    first = rng.normal(size=(loop.carry, lanes))
    rows = rng.normal(size=(20, 6))
    single = bool(number % 2)
    ends = []
    for width in (host_width(single=single), 1):
        kernel = Kernel(loop, Lanes(width, single=single), effort=2 if width > 1 else 0)
        ends.append(kernel.run(first, values, rows, threads=2)[0])
    same = ends[0].tobytes() == ends[1].tobytes()
    assert same or np.array_equal(*ends, equal_nan=True), number
    healthy = np.arange(lanes) % 50 != 0
    assert np.isfinite(ends[0][:, healthy]).mean() > 0.99, (number, n)
print("alive")
"""


@pytest.mark.thorough
@pytest.mark.parametrize("count", ["14", "60"])
def test_random_topologies_with_any_numbers_never_crash_the_process(tmp_path, count):
    """500 lanes each, one in fifty with a mass of 0, -1, 1e300, NaN, infinity or
    5e-324; widths agree.
    """
    tests, source = Path(__file__).parents[1], Path(native.__file__).parents[3]
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(map(str, (source, tests))),
        "SKYARM_CACHE": str(tmp_path),
    }
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, count],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout == "alive\n"
