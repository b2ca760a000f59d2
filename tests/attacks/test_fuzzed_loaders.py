"""Whatever bytes stand in a file, a loader returns what it describes or one line that
names the file, and soon.
"""

from __future__ import annotations

import random
import re
import signal
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from file_mutations import (
    Mutation,
    at_bytes,
    at_words,
    behind_doctype,
    in_archive,
    in_description,
    in_elements,
    in_numbers,
    in_tables,
    with_unbound_prefix,
)

from skyarm.log.flight_log import Log
from skyarm.log.formats import load_log, save_log
from skyarm.log.log_columns import columns
from skyarm.log.metrics.windows import windows_of
from skyarm.log.periods import timed_out
from skyarm.log.ros.topics import FlightTopics
from skyarm.records.files.messages import LONGEST_LINE, one_line, shown
from skyarm.records.files.stl_mesh import read_stl
from skyarm.scenario.scenario_file import LIBRARY as SCENARIOS
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.simulate import run
from skyarm.studies.sweep import StudyError, load_study
from skyarm.studies.sweep.study_file import LIBRARY as STUDIES
from skyarm.vehicle import VehicleError
from skyarm.vehicle.vehicle_files import LIBRARY as VEHICLES
from skyarm.vehicle.vehicle_files import load_vehicle

PATIENCE = 5.0
"""s of processor time that one small file may take."""

LONGEST = 2000
"""Characters of a message: a line, not a page."""

DOCS = Path(__file__).parents[2] / "docs"

URDF = b"""<?xml version="1.0"?>
<robot name="arm">
  <link name="trunk"><inertial><origin xyz="0 0 0.1" rpy="0 0 0.3"/><mass value="1.2"/>
    <inertia ixx="0.01" iyy="0.02" izz="0.02" ixy="0" ixz="0.001" iyz="0"/></inertial>
      </link>
  <link name="upper"><inertial><mass value="0.3"/>
    <inertia ixx="0.001" iyy="0.002" izz="0.002" ixy="0" ixz="0" iyz="0"/></inertial>
      </link>
  <link name="lower"/>
  <link name="tip"><inertial><mass value="0.1"/>
    <inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial>
      </link>
  <joint name="shoulder" type="revolute"><parent link="trunk"/><child link="upper"/>
    <origin xyz="0 0 -0.1"/>
    <axis xyz="0 1 0"/><limit lower="-1.5" upper="1.5" effort="3" velocity="5"/>
    <dynamics damping="0.1" friction="0.01"/></joint>
  <joint name="slide" type="prismatic"><parent link="upper"/><child link="lower"/>
    <axis xyz="0 0 1"/><limit lower="0.1" upper="0.1" effort="3" velocity="5"/></joint>
  <joint name="wrist" type="continuous"><parent link="lower"/><child link="tip"/>
    <origin xyz="0 0 0.2" rpy="0.1 0 0"/>
    <axis xyz="1 0 0"/></joint>
</robot>
"""

MJCF = b"""<?xml version="1.0"?>
<mujoco model="arm">
  <compiler angle="radian"/>
  <default><joint damping="0.01"/><geom density="500"/></default>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 0.1"/>
    <body name="base" pos="0 0 1"><freejoint/>
      <inertial pos="0 0 0.01" mass="1.5" diaginertia="0.02 0.02 0.03"/>
      <body name="upper" pos="0 0 -0.1" euler="0 0 0.2">
        <joint name="yaw" axis="0 0 1" range="-1 1" limited="true"/>
        <joint name="pitch" axis="0 1 0" pos="0 0 0.02" ref="0.1" armature="0.001"
          frictionloss="0.02"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.02"/>
          <site name="tip" pos="0 0 -0.2"/>
        <body name="left"><joint name="l" type="slide" axis="0 1 0"/><geom size="0.01"/>
          </body>
        <body name="right"><joint name="r" type="slide" axis="0 1 0"/>
          <geom size="0.01"/></body>
      </body>
    </body>
  </worldbody>
  <equality><joint joint1="r" joint2="l" polycoef="0 -1 0 0 0"/></equality>
  <actuator><motor name="m" joint="pitch" gear="2" ctrlrange="-1 1" ctrllimited="true"/>
    </actuator>
</mujoco>
"""

GRIPPER = b"""<robot name="gripper">
  <link name="mount"><inertial><mass value="0.1"/>
    <inertia ixx="1e-4" iyy="1e-4" izz="1.9e-4" ixy="0" ixz="0" iyz="0"/></inertial>
      </link>
  <link name="left"><inertial><mass value="0.1"/>
    <inertia ixx="1e-4" iyy="1e-4" izz="2.1e-4" ixy="0" ixz="0" iyz="0"/></inertial>
      </link>
  <link name="right"><inertial><mass value="0.1"/>
    <inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial>
    <visual><geometry><mesh filename="package://gripper/right.stl"/></geometry></visual>
      </link>
  <joint name="l" type="prismatic"><parent link="mount"/><child link="left"/>
    <limit lower="0" upper="0.1"/></joint>
  <joint name="r" type="prismatic"><parent link="mount"/><child link="right"/>
    <mimic joint="l" multiplier="-1" offset="0.01"/></joint>
  <transmission name="t"/>
</robot>
"""

GRIPPER_SOUND = GRIPPER.replace(b"2.1e-4", b"1.9e-4")

ATTACHED = b"""schema = 1
name = "attached"
airframe = "hexarotor_arm6"
end_effector = "left_tip"
mimic = "couple"
[[attach]]
arm = "gripper.urdf"
to = "hand"
position = [0.0, 0.0, -0.1]
rpy = [0.1, 0.2, 0.3]
prefix = "g_"
[[attach]]
arm = "gripper.urdf"
mimic = "lock"
[[joints]]
name = "g_l"
effort_limit = 2.0
[[frames]]
name = "left_tip"
link = "g_left"
"""

STL = (
    b"solid a\n"
    + b"".join(
        b"facet normal 0 0 1\nouter loop\n%s\nendloop\nendfacet\n"
        % b"\n".join(b"vertex %d %d %d" % corner for corner in face)
        for face in (
            ((0, 0, 0), (1, 0, 0), (0, 1, 0)),
            ((0, 0, 0), (0, 0, 1), (1, 0, 0)),
            ((0, 0, 0), (0, 1, 0), (0, 0, 1)),
            ((1, 0, 0), (0, 0, 1), (0, 1, 0)),
        )
    )
    + b"endsolid a\n"
)

STUDY = b"""schema = 1
name = "small"
title = "a small study"
scenario = "case3_wind"
controllers = ["paper_ct"]
duration = 1.0
episodes = 60
chunk = 16
seed = 3
design = "grid"
metrics = ["standard", "gust"]
[windows]
steady = [0.2, 1.0]
holds = [[0.1, 0.5]]
[success]
peak_pitch = 0.5
[vary]
"plant.vehicle.base.mass" = { grid = [0.5, 1.0, 3] }
"environment.wind.force_W.x" = { normal = [1.0, 0.5] }
"sensors.position" = { uniform = [0.0, 0.01] }
"""

SCENARIO = b"""schema = 1
name = "all"
title = "every table"
duration = 0.1
seed = 3
episode = 1
[rates]
physics = 1000
control = 200
reference = 50
[plant]
kind = "rigid_body"
vehicle = "hummingbird_arm2_rotors"
gravity = 9.81
integrator = "rk4"
payload = { mass = 0.02, frame = "tip" }
joints = { damping = 0.002, coulomb = 0.001, coulomb_rate = 0.02, effort_limit = 0.4 }
[model]
vehicle = "hummingbird_arm2"
payload = { mass = 0.01 }
[controller]
law = "hybrid_computed_torque"
mixer = "priority"
rate_error = "corrected"
without = ["coupling"]
[controller.gains]
position = [4.0, 4.0, 4.0]
velocity = [2.2, 2.2, 2.2]
attitude = [0.7, 0.7, 0.035]
rate = [0.1, 0.1, 0.025]
[controller.joint_gains]
stiffness = [350.0, 150.0]
damping = [12.0, 10.0]
[reference]
base = { kind = "circle", center = [0.0, 0.0, 1.0], radius = 1.0, frequency_hz = 0.1 }
yaw = { kind = "ramp", start = 0.02, duration = 0.05, height = 0.1, shape = "quintic" }
joints = [
    { kind = "sine", amplitude = 0.1, frequency_hz = 1.0, start = 0.0, stop = 2.0 },
    0.05,
]
[environment]
ground = false
[environment.wind]
mode = "moving_air"
velocity = [1.0, 0.0, 0.0]
gust.velocity = [0.0, 1.0, 0.0]
gust.start = 0.02
gust.duration = 0.03
gust.shape = "one_minus_cosine"
turbulence = { altitude = 6.0, wind_20ft = 7.7 }
[sensors]
position = 0.002
joint_rates = 0.02
[delays]
measurement = 0.005
command = 0.003
[initial]
quaternion_wxyz = [1.0, 0.0, 0.0, 0.0]
velocity = [0.1, 0.0, 0.0]
joints = [0.1, 0.0]
"""


@dataclass(frozen=True)
class Loader:
    """A kind of file: how it is read, what it may raise, its healthy files, and how
    they are made wrong.
    """

    load: Callable[[Path], Any]
    error: type[Exception]
    suffix: str
    seeds: tuple[bytes, ...]
    mutations: tuple[Mutation, ...] = (at_bytes, at_words, in_tables, in_tables)
    beside: bytes = b""
    """What stands beside them as gripper.urdf."""


def _shipped(folder: Any) -> tuple[bytes, ...]:
    return tuple(
        entry.read_bytes()
        for entry in sorted(folder.iterdir(), key=lambda each: each.name)
    )


def _example(document: str) -> bytes:
    """The example of a page of the documentation: the first TOML that begins with its
    schema.
    """
    blocks = re.split(r"```toml[^\n]*\n", (DOCS / document).read_text("utf-8"))
    return (
        next(block for block in blocks if block.startswith("schema"))
        .split("```")[0]
        .encode()
    )


def _log(kind: str) -> bytes:
    """The log of a short flight."""
    with tempfile.TemporaryDirectory() as folder:
        return save_log(
            run(load_scenario("case1", duration=0.02)), Path(folder) / f"log.{kind}"
        ).read_bytes()


def _used(path: Path) -> Log:
    """A log, and what everything that reads a log asks of it."""
    log = load_log(path)
    try:
        assert isinstance(log.status, str)
        columns(log)
        list(log.phase_ends), list(log.contact_periods), list(log.grasp_periods)
        timed_out(log)
        FlightTopics(log)
        windows_of(log)
        log.scenario  # noqa: B018
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    return log


def _study(path: Path) -> Any:
    """A study."""
    return load_study(path)


def _mesh(path: Path) -> Any:
    try:
        return read_stl(path)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


LOADERS = {
    "vehicle": Loader(
        load_vehicle,
        VehicleError,
        ".toml",
        (*_shipped(VEHICLES), _example("vehicle_files.md")),
    ),
    "urdf": Loader(
        load_vehicle,
        VehicleError,
        ".urdf",
        (URDF, GRIPPER_SOUND),
        (at_bytes, at_words, in_elements, in_elements),
    ),
    "mjcf": Loader(
        load_vehicle,
        VehicleError,
        ".xml",
        (MJCF,),
        (
            at_bytes,
            at_words,
            in_elements,
            in_numbers,
            behind_doctype,
            with_unbound_prefix,
        ),
    ),
    "attached": Loader(
        load_vehicle, VehicleError, ".toml", (ATTACHED,), beside=GRIPPER
    ),
    "log": Loader(
        _used,
        ValueError,
        ".npz",
        (_log("npz"),),
        (at_bytes, in_archive, in_archive, in_description),
    ),
    "messages": Loader(
        _used,
        ValueError,
        ".mcap",
        (_log("mcap"),),
        (at_bytes, in_description, in_description),
    ),
    "mesh": Loader(_mesh, ValueError, ".stl", (STL,), (at_bytes, at_words)),
    "scenario": Loader(
        load_scenario,
        ScenarioError,
        ".toml",
        (*_shipped(SCENARIOS), SCENARIO, SCENARIO, SCENARIO),
    ),
    "study": Loader(
        _study, StudyError, ".toml", (*_shipped(STUDIES), STUDY, STUDY, STUDY)
    ),
}


@contextmanager
def patience() -> Iterator[None]:
    """Cut off what takes longer than it may, so that a hang is a failure of one
    file.
    """

    def stop(_number: int, _frame: Any) -> None:
        raise TimeoutError(f"took more than {PATIENCE} s of processor time")

    if not hasattr(signal, "setitimer"):
        yield
        return
    before = signal.signal(signal.SIGVTALRM, stop)
    signal.setitimer(signal.ITIMER_VIRTUAL, PATIENCE)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)


def answer(loader: Loader, file: Path) -> str | None:
    """What is wrong with a loader's answer to a file, in words; empty for a good line,
    None for a result.
    """
    begin, text = time.process_time(), None
    try:
        with patience():
            loader.load(file)
    except loader.error as error:
        text = str(error)
    except BaseException as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        return (
            f"{type(error).__name__} at {where.filename}:{where.lineno}:"
            f" {str(error)[:200]!r}"
        )
    taken = time.process_time() - begin
    if taken > PATIENCE:
        return f"took {taken:.1f} s"
    if text is None:
        return None
    if len(text.splitlines()) != 1 or not text.isprintable():
        return f"not one line: {text[:300]!r}"
    if str(file) not in text:
        return f"does not name the file: {text[:300]!r}"
    return (
        f"{len(text)} characters: {text[:300]!r}"
        if len(text) > LONGEST + len(str(file))
        else ""
    )


@dataclass
class Attack:
    """How many mutated files loaded, how many were refused, and what went wrong: one
    line each that repeats it.
    """

    loaded: int = 0
    refused: int = 0
    faults: list[str] = field(default_factory=list)


def attack(name: str, count: int, folder: Path, seed: int) -> Attack:
    """Files made wrong, and what their loader answers."""
    loader, found = LOADERS[name], Attack()
    file = folder / f"{name}{loader.suffix}"
    (folder / "gripper.urdf").write_bytes(loader.beside)
    for number in range(count):
        rng = random.Random(f"{seed} {name} {number}")
        healthy = rng.choice(loader.seeds)
        file.write_bytes(rng.choice(loader.mutations)(healthy, rng))
        wrong = answer(loader, file)
        if wrong is None:
            found.loaded += 1
        elif not wrong:
            found.refused += 1
        else:
            found.faults.append(f"{name} {number} of seed {seed}: {wrong}")
    return found


@pytest.mark.parametrize("name", LOADERS)
def test_healthy_files_load_with_and_without_a_byte_order_mark(
    name: str, tmp_path: Path
) -> None:
    loader = LOADERS[name]
    (tmp_path / "gripper.urdf").write_bytes(loader.beside)
    for healthy in loader.seeds:
        for mark in (
            (b"", b"\xef\xbb\xbf")
            if loader.suffix not in (".npz", ".mcap", ".stl")
            else (b"",)
        ):
            file = tmp_path / f"healthy{loader.suffix}"
            file.write_bytes(mark + healthy)
            loader.load(file)


DEEP = {
    "arrays": b"x = " + b"[" * 3000 + b"]" * 3000,
    "tables": b"x = " + b"{a=" * 3000 + b"1" + b"}" * 3000,
    "arrays that parse": b"x = " + b"[" * 70 + b"]" * 70,
    "a key of 30 000 parts": b"a." * 30_000 + b"b = 1",
    "a table of 3000 parts": b"[" + b"'a'." * 3000 + b"b]",
    "5000 digits": b"x = " + b"9" * 5000,
    "5000 hexadecimal digits": b"x = [1, 0x" + b"f" * 5000 + b"]",
}


@pytest.mark.parametrize("content", DEEP.values(), ids=DEEP)
@pytest.mark.parametrize("name", ["vehicle", "scenario", "study"])
def test_depth_and_digits_beyond_measure_are_refused(
    name: str, content: bytes, tmp_path: Path
) -> None:
    file = tmp_path / "deep.toml"
    file.write_bytes(content)
    assert answer(LOADERS[name], file) == ""
    with pytest.raises(
        LOADERS[name].error,
        match=(
            r"deep\.toml: .*must be (nested at most 64 deep|at most 1\.8e308 in size)$"
        ),
    ):
        LOADERS[name].load(file)


def test_a_message_is_one_line_of_bounded_length() -> None:
    line = one_line("a\nb\x1b[2J\u202e" + "x" * 10_000 + "end")
    assert line.startswith("a b\\x1b[2J\\u202exxx")
    assert line.endswith("end")
    assert len(line) <= LONGEST_LINE
    assert one_line("x" * LONGEST_LINE) == "x" * LONGEST_LINE


def test_a_value_that_python_refuses_to_write_out_is_shown_by_its_type() -> None:
    nested: list[Any] = []
    for _ in range(100_000):
        nested = [nested]
    assert shown(10**5000) == "(int too large to show)"
    assert shown(nested) == "(list too large to show)"


LEAST = {"log": 0.005}
"""Share of the wrong files that must load; arrays of a log must fit each other, so that
most changes are refused."""

QUICK = {
    "vehicle": 150,
    "urdf": 125,
    "mjcf": 75,
    "attached": 50,
    "scenario": 100,
    "study": 75,
    "log": 100,
    "messages": 50,
    "mesh": 50,
}


@pytest.mark.parametrize("name", LOADERS)
def test_some_hundred_wrong_files(name: str, tmp_path: Path) -> None:
    found = attack(name, QUICK[name], tmp_path, seed=1)
    assert not found.faults, "\n".join(found.faults)
    assert found.loaded > LEAST.get(name, 0.02) * QUICK[name], (
        "mutations that are all fatal test nothing beyond the first check"
    )
    assert found.refused > 0.2 * QUICK[name]


# of odd numbers
@pytest.mark.filterwarnings(
    "ignore::skyarm.scenario.without_effect.WithoutEffectWarning"
)
@pytest.mark.attack
@pytest.mark.parametrize("part", range(10))
@pytest.mark.parametrize("name", LOADERS)
def test_twenty_thousand_wrong_files(name: str, part: int, tmp_path: Path) -> None:
    found = attack(name, 4 * QUICK[name], tmp_path, seed=100 + part)
    assert not found.faults, "\n".join(found.faults)


def test_a_loader_that_hangs_or_breaks_is_found(tmp_path: Path) -> None:
    """The attack itself: what it must call a fault."""
    file = tmp_path / "x.toml"

    def raises(error: BaseException) -> str | None:
        def load(_path: Path) -> None:
            raise error

        return answer(Loader(load, VehicleError, ".toml", ()), file)

    assert raises(VehicleError(f"{file}: mass = 1: must be 2")) == ""
    assert "RecursionError at" in str(raises(RecursionError("deep")))
    assert "ValueError at" in str(raises(ValueError(f"{file}: wrong")))
    assert "not one line" in str(raises(VehicleError(f"{file}: a\nb")))
    assert "not one line" in str(raises(VehicleError(f"{file}: \x1b[2J")))
    assert "does not name the file" in str(raises(VehicleError("mass = 1")))
    assert "characters" in str(raises(VehicleError(f"{file}{'x' * 3000}")))
