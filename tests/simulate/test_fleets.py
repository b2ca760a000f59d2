"""A fleet, equal vehicles of which none acts on another: its period is compiled once,
to the bits of any team's.
"""

from __future__ import annotations

import dataclasses
import subprocess
import sys
import time
import tomllib

import numpy as np
import pytest

import skyarm
from skyarm.compile.llvm import kernel, object_cache
from skyarm.compile.tracing.lower import operations
from skyarm.records.files import own_sources
from skyarm.records.leaves import leaves
from skyarm.scenario.scenario_record import Delays
from skyarm.simulate import period, stored_programs
from skyarm.simulate.engine import Engine, EpisodeCode

FLEET = """
schema = 1
name = "fleet"
duration = 0.6
[plant]
vehicle = "dragonfly"
[controller]
preset = "centroidal_joint"
[sensors]
position = 0.003
rate = 0.03
[environment.wind]
mode = "moving_air"
velocity = [2.0, 0.5, 0.0]
turbulence = { altitude = 6.0, wind_20ft = 7.7 }
"""


def fleet(count=4, sinks=(), reference=None, **changes):
    """Vehicles beside each other on paths of their own, through the ground where they
    sink.
    """
    tables = tomllib.loads(FLEET) | changes
    tables["agents"] = {}
    for i in range(count):
        end = [0.2 * i, 2.0 * i, -3.0 if i in sinks else 1.3]
        motion = {
            "kind": "waypoints",
            "points": [[0.0, 2.0 * i, 0.3], end],
            "times": [0.0, 0.8],
        }
        tables["agents"][f"a{i}"] = {"reference": {"base": motion, **(reference or {})}}
    return skyarm.scenario_from(tables)


def flown(scenario, monkeypatch, steps):
    """Log, last state and written operations of a flight, with that number of steps up
    to which it is a fleet's.
    """
    monkeypatch.setattr(period, "SHARES", steps)
    code = EpisodeCode(scenario, commands=False)
    engine = Engine(code)
    while engine.fly(scenario.steps):
        pass
    written = operations(code.loop.program.nodes, written=True)
    return (
        engine.recorder.table[: engine.tick],
        np.array(leaves(engine.now)),
        engine.ended,
        written,
    )


@pytest.mark.parametrize("sinks", [(), (2,), (1, 3)])
def test_a_fleet_flies_to_the_bits_of_a_team_whose_period_is_written_out(
    sinks, monkeypatch
):
    scenario = fleet(sinks=sinks)
    shared, plain = (flown(scenario, monkeypatch, steps) for steps in (10**6, -1))
    assert shared[0].tobytes() == plain[0].tobytes()
    assert shared[1].tobytes() == plain[1].tobytes()
    assert shared[2] == plain[2]
    assert (shared[2] is not None) == bool(sinks)
    assert (
        len(shared[0]) < scenario.steps if sinks else len(shared[0]) == scenario.steps
    )
    assert shared[3] < 0.75 * plain[3]


def test_each_further_vehicle_of_a_fleet_writes_the_passing_of_its_numbers_alone(
    monkeypatch,
):
    sizes = [flown(fleet(count), monkeypatch, 10**6)[3] for count in (4, 8)]
    assert sizes[1] < 1.1 * sizes[0]


def taken(scenario, monkeypatch, **options):
    """Whether a flight's program is that of a fleet: it has one shared function, of
    which teams have several.
    """
    monkeypatch.setattr(period, "SHARES", 10**6)
    loop = EpisodeCode(scenario, **{"commands": False} | options).loop
    calls = [node.value for node in loop.program.nodes if node.op == "apply"]
    return len(calls) == len(scenario.agents)


def with_second(scenario, **fields):
    """The scenario with other fields of its second vehicle."""
    agents = dict(scenario.agents)
    agents["a1"] = dataclasses.replace(agents["a1"], **fields)
    return dataclasses.replace(scenario, agents=agents)


def test_vehicles_that_differ_or_act_on_each_other_are_no_fleet(monkeypatch):
    one = fleet()
    assert taken(one, monkeypatch)
    plant = one.agents["a1"].plant
    assert not taken(
        with_second(one, plant=dataclasses.replace(plant, gravity=9.8)), monkeypatch
    )
    assert not taken(with_second(one, delays=Delays(command=0.005)), monkeypatch)
    # until then each holds the first sample of its own path
    assert not taken(fleet(reference={"tracking_start": 0.2}), monkeypatch)
    ball = {
        "name": "ball",
        "shape": "box",
        "size": [0.1, 0.1, 0.1],
        "mass": 0.1,
        "position": [0.0, 0.0, 5.0],
    }
    assert not taken(fleet(world={"objects": [ball]}), monkeypatch)


@pytest.mark.parametrize("pushed", ["a0", "a2"])
def test_a_wind_on_one_vehicle_of_a_fleet_pushes_no_other(pushed, monkeypatch):
    wind = {"mode": "force_wind", "force": [0.0, 1.0, 0.0], "agent": pushed}
    scenario = fleet(environment={"wind": wind}, sensors={})
    assert not taken(scenario, monkeypatch)
    log = skyarm.run(scenario)
    calm = skyarm.run(fleet(environment={}, sensors={}))
    moved = {
        name: log.agents[name].position[-1, 1] - calm.agents[name].position[-1, 1]
        for name in log.agents
    }
    assert [name for name, size in moved.items() if size > 0.01] == [pushed]
    assert sorted(map(abs, moved.values()))[-2] < 1e-9


def test_a_flight_that_is_long_or_commanded_or_compiled_in_full_shares_no_period(
    monkeypatch,
):
    assert not taken(fleet(), monkeypatch, effort=2)
    assert not taken(fleet(), monkeypatch, commands=True)
    monkeypatch.undo()
    for count, duration, expected in (
        (3, 0.6, False),
        (4, 15.0, True),
        (4, 15.1, False),
        (8, 75.0, True),
    ):
        loop = EpisodeCode(fleet(count, duration=duration), commands=False).loop
        calls = sum(node.op == "apply" for node in loop.program.nodes)
        assert (calls == count) == expected, (count, duration)


def test_a_fleet_flown_again_has_code_of_each_vehicle_made_behind_the_command(
    monkeypatch, tmp_path
):
    monkeypatch.setenv("SKYARM_CACHE", str(tmp_path))
    monkeypatch.setattr(own_sources, "_begun", [time.time() + 60.0])
    monkeypatch.setattr(stored_programs, "_fleets", [])
    monkeypatch.delenv("SKYARM_EFFORT", raising=False)
    small = {
        "plant": {"vehicle": "hummingbird_arm2_rotors"},
        "controller": {"preset": "paper_pd"},
    }
    scenario, began = fleet(duration=0.05, sensors={}, environment={}, **small), []
    monkeypatch.setattr(
        stored_programs, "work_behind", lambda *words: began.append(words)
    )
    logs = [skyarm.run(scenario)]
    stored_programs.optimise_repeated()
    assert began == []
    logs.append(skyarm.run(scenario))
    stored_programs.optimise_repeated()
    command, text = began.pop()
    name = stored_programs.program_name(scenario, False, None)
    shared = stored_programs.load_program(name)
    assert shared.shared
    done = subprocess.run(
        [sys.executable, "-c", command],
        input=text,
        text=True,
        check=False,
        capture_output=True,
    )
    assert (done.returncode, done.stderr) == (0, "")
    program = stored_programs.load_program(name)
    assert program is not None
    assert not program.shared
    assert program.assembly.written > 1.3 * shared.assembly.written
    assert (
        object_cache.load(kernel._identity(program.assembly.text, kernel.FULL))
        is not None
    )
    monkeypatch.setattr(stored_programs, "_fleets", [])
    logs.append(skyarm.run(scenario))
    assert stored_programs._fleets == [], "it has what it needs"
    for one in logs[0].agents:
        assert len({log.agents[one].rotor_commands.tobytes() for log in logs}) == 1
