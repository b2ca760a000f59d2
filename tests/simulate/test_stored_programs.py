"""A repeated command flies the stored program of its flight, and never that of another
flight or of other code.
"""

import os
import subprocess
import sys
import time
from dataclasses import dataclass, replace

import numpy as np
import pytest

import skyarm
from skyarm.compile.llvm import object_cache
from skyarm.records.files import own_sources
from skyarm.scenario.numbers import with_numbers
from skyarm.simulate import stored_programs
from skyarm.simulate.engine import EpisodeCode
from skyarm.simulate.program import ProgramKey
from skyarm.simulate.stored_programs import load_program, program_name
from skyarm.world.wind import ForceWind


@pytest.fixture(autouse=True)
def command(monkeypatch, tmp_path):
    """This process as that of a command, with a cache of its own."""
    monkeypatch.setenv("SKYARM_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(own_sources, "_begun", [time.time() + 60.0])


def refuse_tracing(monkeypatch):
    def refused(*_, **__):
        raise AssertionError("traced")

    monkeypatch.setattr("skyarm.simulate.program.trace_loop", refused)


def flight(name="case3_wind", **numbers):
    return skyarm.load_scenario(name, duration=0.2, **numbers)


def require_same_bits(one, other):
    assert one.arrays().keys() == other.arrays().keys()
    for name, values in one.arrays().items():
        assert np.array_equal(
            values.view(np.int64), other.arrays()[name].view(np.int64)
        ), name


@pytest.mark.parametrize("name", ["case3_wind", "press_and_hold"])
def test_a_second_flight_traces_nothing_and_has_the_same_bits(monkeypatch, name):
    first = skyarm.run(flight(name))
    refuse_tracing(monkeypatch)
    require_same_bits(first, skyarm.run(flight(name)))


def test_a_program_flown_again_is_compiled_at_full_effort_behind_the_command(
    monkeypatch,
):
    texts, passed = [], []
    monkeypatch.setattr(stored_programs, "_repeated", texts)
    monkeypatch.setattr(stored_programs, "compile_behind", passed.append)
    monkeypatch.setattr(stored_programs, "REPEATS", 10**6)
    skyarm.run(flight())
    assert texts == []
    skyarm.run(flight())
    monkeypatch.setattr(stored_programs, "REPEATS", 1)
    skyarm.run(flight())
    stored_programs.optimise_repeated()
    assert passed == texts
    assert len(texts) == 1


def test_the_second_flight_of_a_team_that_carries_is_worth_its_optimisation(
    monkeypatch,
):
    texts = []
    monkeypatch.setattr(stored_programs, "_repeated", texts)
    scenario = skyarm.load_scenario("two_carry_a_bar")
    assert EpisodeCode(scenario, commands=False).program.assembly.effort == 0
    assert texts == []
    EpisodeCode(scenario, commands=False)
    assert len(texts) == 1


def test_a_flight_in_which_a_number_changes_has_the_same_bits_and_its_scheduled_end(
    monkeypatch,
):
    changed = replace(
        flight(), changes=(skyarm.Change(at=0.1, path="plant.gravity", value=12.0),)
    )
    monkeypatch.setattr(own_sources, "_begun", [])
    plain = skyarm.run(changed)
    monkeypatch.setattr(own_sources, "_begun", [time.time() + 60.0])
    for _ in range(2):
        require_same_bits(plain, skyarm.run(changed))


def test_a_stored_program_has_the_steps_that_decide_whether_it_fits_another_scenario():
    code = EpisodeCode(flight("press_and_hold"), commands=False)
    again = EpisodeCode(flight("press_and_hold"), commands=False)
    assert code.substeps.traced
    assert again.substeps.traced == code.substeps.traced
    assert not again.loop.program.nodes, "it is the stored one"


def test_outside_a_command_every_flight_is_traced(monkeypatch):
    skyarm.run(flight())
    monkeypatch.setattr(own_sources, "_begun", [])
    refuse_tracing(monkeypatch)
    with pytest.raises(AssertionError, match="traced"):
        skyarm.run(flight())


def test_each_bit_of_the_scenario_and_each_detail_has_a_program_of_its_own(monkeypatch):
    whole = flight()
    vehicle = whole.agent.plant.vehicle
    mass = replace(vehicle.base, mass=np.nextafter(vehicle.base.mass, 1.0).item())
    plant = replace(whole.agent.plant, vehicle=replace(vehicle, base=mass))
    heavier = whole.with_agent(replace(whole.agent, plant=plant))
    names = [
        program_name(whole, False, None),
        program_name(heavier, False, None),
        program_name(whole, True, None),
    ]
    names += [program_name(flight(seed=3), False, None), program_name(whole, False, 0)]
    monkeypatch.setenv(
        "OPENBLAS_CORETYPE", os.environ.get("OPENBLAS_CORETYPE", "") + "other"
    )
    names += [program_name(whole, False, None)]
    monkeypatch.setattr(np, "__version__", "0.0")
    names += [program_name(whole, False, None)]
    assert all(names)
    assert len({*names}) == len(names)


@dataclass(frozen=True)
class OwnWind(ForceWind):
    """Wind of the user's."""

    def force_of_mine(self):
        return 1.0


def test_a_flight_with_code_of_the_users_is_not_stored():
    assert program_name(replace(flight(), wind=OwnWind())) == ""
    skyarm.run(replace(flight(), wind=OwnWind()))
    assert object_cache.contents().entries == 1, "its machine code alone"


@pytest.mark.parametrize("of", ["sources_digest", "sources_stamp"])
def test_the_digest_is_of_all_source_files_unless_one_changed_since_the_start(
    monkeypatch, tmp_path, of
):
    package = tmp_path / "package"
    (package / "inner" / "__pycache__").mkdir(parents=True)
    (package / "a.py").write_text("A = 1")
    (package / "inner" / "b.toml").write_text("b = 1")
    monkeypatch.setattr(own_sources, "PACKAGE", f"{package}{os.sep}")
    begins = iter(range(60, 1000))

    def digest():
        monkeypatch.setattr(own_sources, "_begun", [time.time() + next(begins)])
        return getattr(own_sources, of)()

    seen = [digest()]
    (package / "inner" / "__pycache__" / "a.pyc").write_bytes(b"made by Python")
    assert digest() == seen[0]
    for file, text in (("inner/b.toml", "b = 2"), ("a.py", "A = 2"), ("c.py", "")):
        (package / file).write_text(text)
        seen.append(digest())
    (package / "a.py").rename(package / "b.py")
    seen.append(digest())
    assert len({*seen}) == len(seen)
    assert all(len(each) == 64 for each in seen)
    os.utime(package / "c.py", (1.0, 1.0))
    assert (digest() == seen[-1]) is (of == "sources_digest"), (
        "the same content at another time"
    )
    monkeypatch.setattr(own_sources, "_begun", [time.time() - 60.0])
    assert own_sources.sources_stamp() == ""


def test_a_process_that_loaded_the_library_before_the_command_is_none_of_a_command(
    monkeypatch,
):
    monkeypatch.setattr(own_sources, "_begun", [])
    own_sources.begin_command()
    assert own_sources.sources_stamp() == ""


def test_the_command_stores_a_program_that_another_process_finds(monkeypatch, tmp_path):
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "1")
    monkeypatch.setenv("MKL_NUM_THREADS", "1")
    words = [
        sys.executable,
        "-m",
        "skyarm",
        "run",
        "case3_wind",
        "--duration",
        "0.2",
        "--out",
        str(tmp_path),
    ]
    subprocess.run(words, check=True, capture_output=True)
    assert load_program(program_name(flight(), False, None)) is not None
    refuse_tracing(monkeypatch)
    require_same_bits(
        skyarm.load_log(tmp_path / "case3_wind.npz"), skyarm.run(flight())
    )


def test_a_program_with_numbers_is_traced_with_them():
    scenario, key = flight(), ProgramKey(free=("plant.gravity",))
    for _ in range(2):
        assert EpisodeCode(scenario).loop.parameters == 0
        code = EpisodeCode(
            scenario,
            lambda values: with_numbers(scenario, {"plant.gravity": values[0]}),
            (9.81,),
            key=key,
        )
        assert code.loop.parameters == 1
