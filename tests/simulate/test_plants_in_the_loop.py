"""Both plants in the closed loop: with loads at each stage they differ by no more than
their own integration errors.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from bench_engines import Flight

from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.plant.compiled import Steps
from skyarm.scenario.scenario_file import load_scenario, scenario_from
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.simulate.loop import run
from support.cases import sampled
from support.flights import document

CASES = ("case1", "case2", "case2_gust", "case3", "case3_wind")
SECONDS = {
    "case1": 8.0,
    "case2": 8.0,
    "case2_gust": 8.0,
    "case3": 12.0,
    "case3_wind": 12.0,
}
"""Long enough for a step of the reference or the gust to come."""

RICHARDSON = 16.0 / 15.0
"""Of a method of fourth order the error with a step, over what half the step
changes."""

ROUNDING = 1e-11
"""m, 1 or rad: two orders above what both plants differ by with semi-implicit Euler,
which is one method for both."""


def ours(scenario, substeps):
    """Poses and joints of the rigid-body plant with so many Runge-Kutta steps a control
    period.
    """
    flight = Flight.of(scenario, lambda _seconds: Steps(substeps))
    kernel = Kernel(flight.loop, Lanes(1), logging=True)
    _, log = kernel.run(flight.carry[:, None], flight.parameters[:, None], flight.rows)
    return log[:, [*range(7), *range(13, 13 + scenario.plant.vehicle.n)], 0]


def mujocos(scenario, integrator, physics=1000):
    """The same of MuJoCo's plant."""
    rates = dataclasses.replace(scenario.rates, physics=physics)
    log = run(
        dataclasses.replace(scenario, kind="mujoco", integrator=integrator, rates=rates)
    )
    assert log.info["status"] == "completed"
    return np.hstack([log.position, log.quaternion, log.joints])


def farthest(a, b):
    """Largest difference of position (m), quaternion and joints (rad)."""
    return np.array(
        [
            np.abs(a[:, part] - b[:, part]).max()
            for part in (slice(0, 3), slice(3, 7), slice(7, None))
        ]
    )


@pytest.mark.parametrize("case", sampled(CASES, 5, keep=("case3_wind",)))
def test_loads_at_each_stage_bring_the_plants_together(case):
    """Each plant's error is what half its step changes, by Richardson; the flights
    differ by their sum at most.
    """
    pytest.importorskip("mujoco")
    scenario = load_scenario(case, duration=SECONDS[case])
    rigid, staged = ours(scenario, 1), mujocos(scenario, "rk4_staged")
    errors = farthest(rigid, ours(scenario, 2)) + farthest(
        staged, mujocos(scenario, "rk4_staged", 2000)
    )
    apart = farthest(rigid, staged)
    assert np.all(apart <= RICHARDSON * errors + ROUNDING), (apart, errors)
    # 0.15 um of the base, 0.1 urad of the joints; a hundredth of what held loads, with
    # the rotors' impulse, leave
    assert np.all(errors < 1.5e-7)
    assert np.all(apart < 1e-2 * farthest(rigid, mujocos(scenario, "rk4")))
    # and the flight must be worth comparing
    assert np.ptp(rigid[:, 7:], axis=0).max() > 0.1


def test_the_rigid_body_plant_takes_both_names_for_one_method():
    scenario = load_scenario("case3_wind", duration=1.0)
    logs = [
        run(dataclasses.replace(scenario, integrator=name))
        for name in ("rk4", "rk4_staged")
    ]
    assert np.array_equal(logs[0].position, logs[1].position)
    assert np.array_equal(logs[0].joint_rates, logs[1].joint_rates)
    assert [log.info["integrator"] for log in logs] == ["rk4", "rk4_staged"]


def test_a_scenario_file_takes_the_integrator_by_name():
    pytest.importorskip("mujoco")
    scenario = scenario_from(
        document(
            "case3_wind",
            duration=1.0,
            reference__base__start=0.2,
            plant__kind="mujoco",
            plant__integrator="rk4_staged",
        )
    )
    assert (scenario.kind, scenario.integrator) == ("mujoco", "rk4_staged")
    log, held = run(scenario), run(dataclasses.replace(scenario, integrator="rk4"))
    assert log.info["integrator"] == "rk4_staged"
    assert 0.0 < np.abs(log.position - held.position).max() < 1e-3
    with pytest.raises(ScenarioError, match=r"integrator = 'rk4_stages'.*rk4_staged"):
        scenario_from(document("case3", plant__integrator="rk4_stages"))
