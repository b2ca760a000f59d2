"""Wrong planning tasks: each is refused in one line with file, field, value and what is
allowed.
"""

from __future__ import annotations

from math import inf, nan
from pathlib import Path
from typing import Any

import pytest

from skyarm.planning.task import TaskError, list_tasks, load_task, task_from
from skyarm.vehicle.vehicle_files import list_vehicles
from support.cases import toml_text
from support.plans import reach

VEHICLES = ", ".join(list_vehicles())

WRONG: list[tuple[dict[str, Any], str]] = [
    ({"schema": 2}, "schema = 2: must be 1"),
    (
        {"vehicle": "hexa"},
        (
            f"vehicle = 'hexa': must be one of {VEHICLES}, or the path of a .toml,"
            " .urdf, .sdf or .xml (MJCF) file"
        ),
    ),
    ({"vehicle": None}, "vehicle: is missing; there are name, phases, schema, start"),
    ({"vehicle": 3}, "vehicle = 3: must be a name or a path"),
    (
        {"obstacle": []},
        (
            "obstacle = []: unknown field; did you mean 'obstacles'? allowed: name,"
            " vehicle, start, phases, limits, obstacles, minimise, world, passable,"
            " gravity, step"
        ),
    ),
    ({"minimise": "energy"}, "minimise = 'energy': must be one of effort, time"),
    ({"gravity": -1.0}, "gravity = -1.0: must be above 0"),
    ({"gravity": 0.0}, "gravity = 0.0: must be above 0"),
    ({"step": 1.0}, "step = 1.0: must be at most 0.5"),
    ({"name": 3}, "name = 3: must be text"),
    ({"phases": []}, "phases: must be one phase or more"),
    ({"phases": None}, "phases: must be one phase or more"),
    (
        {"phases": {"a": 1}},
        "phases = {'a': 1}: must be a list of tables, each below [[phases]]",
    ),
    (
        {"phases__0__kind": "fly"},
        "phases[0].kind = 'fly': must be one of go, hold, contact",
    ),
    ({"phases__0__duration": 0.0}, "phases[0].duration = 0.0: must be at least 0.02"),
    (
        {"phases__0__duration": "1 s"},
        "phases[0].duration = '1 s': must be a finite number",
    ),
    ({"phases__0__duration": nan}, "phases[0].duration = nan: must be a finite number"),
    ({"phases__0__step": 1.0}, "phases[0].step = 1.0: must be at most 0.5"),
    (
        {"phases__0__to": {"top": [0, 0, 0]}},
        (
            "phases[0].to.top = [0, 0, 0]: unknown field; did you mean 'tip'? allowed:"
            " tip, tip_velocity, tip_axis, base, velocity, attitude, heading, joints,"
            " rest"
        ),
    ),
    (
        {"phases__0__to": {"tip": [0, 0]}},
        "phases[0].to.tip = [0, 0]: must be three numbers",
    ),
    (
        {"phases__0__to": {"tip": [0, 0, inf]}},
        "phases[0].to.tip[2] = inf: must be a finite number",
    ),
    ({"phases__0__to": "there"}, "phases[0].to = 'there': must be a table"),
    (
        {"phases__2__to__joints": [0.0]},
        (
            "phases[2].to.joints = [0.0]: must be 3 positions, one for each joint, or"
            " left out"
        ),
    ),
    (
        {"phases__2__to__joints": "zero"},
        "phases[2].to.joints = 'zero': must be a list of numbers",
    ),
    (
        {"phases__2__to": {"attitude": [0, 0]}},
        "phases[2].to.attitude = [0.0, 0.0]: must be three angles, rad",
    ),
    (
        {"phases__2__to": {"attitude": [0, 0, 0], "heading": 1.0}},
        "phases[2].to.heading = 1: must be left out beside attitude",
    ),
    ({"phases__2__to__rest": 1}, "phases[2].to.rest = 1: must be true or false"),
    (
        {"phases__1__kind": "contact"},
        "phases[1].contact: is missing; a phase of kind 'contact' needs one",
    ),
    (
        {"phases__1__contact": {}},
        "phases[1].contact: must be left out in a phase of kind 'hold'",
    ),
    (
        {"phases__1": {"kind": "contact", "contact": {"kind": "line"}}},
        (
            "phases[1].contact.kind = 'line': did you mean 'plane'? must be one of"
            " point, bar, plane"
        ),
    ),
    (
        {"phases__1": {"kind": "contact", "contact": {"friction": -0.1}}},
        "phases[1].contact.friction = -0.1: must be at least 0",
    ),
    (
        {"phases__1": {"kind": "contact", "contact": {"normal": [0, 0, 0]}}},
        (
            "phases[1].contact.normal = (0.0, 0.0, 0.0): must be a unit vector, its"
            " length is 0"
        ),
    ),
    (
        {"phases__1": {"kind": "contact", "contact": {"normal": [0, 0, 2]}}},
        (
            "phases[1].contact.normal = (0.0, 0.0, 2.0): must be a unit vector, its"
            " length is 2"
        ),
    ),
    (
        {"phases__1": {"kind": "contact", "contact": {"force": -2}}},
        "phases[1].contact.force = -2: must be at least 0",
    ),
    (
        {"phases__1__to": {"tip_velocity": [0.1, 0, 0]}},
        (
            "phases[1]: to.tip_velocity = [0.1, 0.0, 0.0]: must be left out or zero;"
            " the tip rests in this phase"
        ),
    ),
    (
        {"phases__0__to__tip_velocity": [0, 1, 0]},
        (
            "phases[1]: to.tip_velocity = [0.0, 1.0, 0.0] of the phase before: must be"
            " left out or zero; the tip rests in this phase"
        ),
    ),
    (
        {"phases__0__to": {"base": [0, 0, 0]}},
        (
            "phases[1]: the tip rests where the phase before leaves it, which must say"
            " to.tip"
        ),
    ),
    ({"start__position": [0, 0]}, "start.position = [0, 0]: must be three numbers"),
    (
        {"start__joints": [0.0]},
        "start.joints = [0.0]: must be 3 positions, one for each joint, or left out",
    ),
    ({"start__attitude": [0.0]}, "start.attitude = [0.0]: must be three angles, rad"),
    (
        {"start__velocity": [0, 0, 0]},
        (
            "start.velocity = [0, 0, 0]: unknown field; allowed: position, attitude,"
            " joints"
        ),
    ),
    ({"limits": {"tilt": 4.0}}, "limits.tilt = 4.0: must be at most 3.14159"),
    ({"limits": {"thrust_share": 1.5}}, "limits.thrust_share = 1.5: must be at most 1"),
    (
        {"limits": {"torque_share": 0.0}},
        "limits.torque_share = 0.0: must be at least 0.05",
    ),
    ({"limits": {"joint_rate": 0}}, "limits.joint_rate = 0: must be at least 0.01"),
    ({"limits": {"speed": -1}}, "limits.speed = -1: must be at least 0.01"),
    ({"limits": {"clearance": -1}}, "limits.clearance = -1: must be at least 0"),
    ({"limits": {"rotor_lag": 0.0}}, "limits.rotor_lag = 0.0: must be at least 0.01"),
    (
        {"limits": {"tilts": 1}},
        (
            "limits.tilts = 1: unknown field; did you mean 'tilt'? allowed: tilt,"
            " thrust_share, torque_share, joint_rate, speed, rate, clearance, rotor_lag"
        ),
    ),
    (
        {"obstacles": [{"shape": "pyramid", "position": [0, 0, 0], "size": [1]}]},
        (
            "obstacles[0].shape = 'pyramid': must be one of plane, box, cylinder,"
            " sphere, hole, capsule, hull, heightfield"
        ),
    ),
    (
        {"obstacles": [{"shape": "box", "position": [0, 0, 0], "size": [1, 1]}]},
        "obstacles[0].size = [1.0, 1.0]: must be 3 numbers, x, y, z",
    ),
    (
        {"obstacles": [{"shape": "box", "position": [0, 0, 0], "size": [1, 1, -1]}]},
        "obstacles[0].size[2] = -1.0: must be above 0",
    ),
    (
        {
            "obstacles": [
                {
                    "shape": "box",
                    "position": [0, 0, 0],
                    "size": [1, 1, 1],
                    "colour": "red",
                }
            ]
        },
        (
            "obstacles[0].colour = 'red': unknown field; "
            "allowed: name, shape, size, position, angles, motion, material, mesh,"
            " vertices, heights"
        ),
    ),
    (
        {
            "obstacles": [
                {"shape": "box", "position": [0, 0, 0], "size": [1, 1, 1], "name": "a"},
                {"shape": "box", "position": [1, 0, 0], "size": [1, 1, 1], "name": "a"},
            ]
        },
        "obstacles: name = 'a' stands twice; names must be unique",
    ),
    (
        {
            "obstacles": [
                {
                    "shape": "box",
                    "position": [0, 0, 0],
                    "size": [1, 1, 1],
                    "velocity": [1, 0, 0],
                }
            ]
        },
        (
            "obstacles[0].velocity = [1, 0, 0]: unknown field; "
            "allowed: name, shape, size, position, angles, motion, material, mesh,"
            " vertices, heights"
        ),
    ),
    (
        {"obstacles": {"shape": "box"}},
        (
            "obstacles = {'shape': 'box'}: must be a list of tables, each below"
            " [[obstacles]]"
        ),
    ),
    (
        {
            "obstacles": [
                {"shape": "box", "position": [0, 0, 0], "size": [1, 1, 1], "name": 3}
            ]
        },
        "obstacles[0].name = 3: must be text",
    ),
    (
        {
            "obstacles": [
                {"shape": "hole", "position": [0, 0, 0], "size": [1, 1, 0.1, 0.2]}
            ]
        },
        (
            "obstacles[0].size = [1.0, 1.0, 0.1, 0.2]: must be 5 numbers, radius,"
            " depth, chamfer, outer radius, length"
        ),
    ),
    ({"passable": ["x"]}, "passable = ['x']: must be names of surfaces of the world"),
    ({"passable": "x"}, "passable = 'x': must be names of surfaces of the world"),
    ({"world": 3}, "world = 3: must be a table"),
    ({"world": {"grippers": 3}}, "world.grippers = 3: must be a list of tables"),
    (
        {
            "phases__1__gripper": "hand",
            "world": {"grippers": [{"name": "claw"}, {"name": "hook"}]},
        },
        (
            "phases[1].gripper = 'hand': must be a gripper of [[world.grippers]], one"
            " of claw, hook"
        ),
    ),
    (
        {"phases__2__release": "hand", "world": {"grippers": [{"name": "claw"}]}},
        (
            "phases[2].release = 'hand': must be a gripper of [[world.grippers]], one"
            " of claw"
        ),
    ),
    (
        {"phases__1__gripper": "claw", "world": {"surfaces": []}},
        "phases[1].gripper = 'claw': must be left out without [[world.grippers]]",
    ),
    (
        {"phases__2__release": "claw", "world": {"grippers": []}},
        "phases[2].release = 'claw': must be left out without [[world.grippers]]",
    ),
    ({"phases__0__tilt": 3.2}, "phases[0].tilt = 3.2: must be at most 3.14159"),
    ({"phases__0__tilt": 0.0}, "phases[0].tilt = 0.0: must be at least 0.01"),
    (
        {"vehicle": "hummingbird"},
        (
            "phases[2].to.joints = [0.0, 0.0, 0.0]: must be 0 positions, one for each"
            " joint, or left out"
        ),
    ),
    (
        {"vehicle": "voliro_like", "phases": [{"to": {"base": [0, 0, 0]}}]},
        "vehicle = 'voliro_like': must have no tilting rotors; no plan turns them",
    ),
    (
        {"vehicle": "hummingbird_arm2", "phases": [{"to": {"base": [0, 0, 0]}}]},
        (
            "vehicle 'hummingbird_arm2': links[link1].planar = True: must be false in a"
            " plant (a planar inertia is impossible for a real body; such a vehicle is"
            " a controller's model only)"
        ),
    ),
    ({"start": 3}, "start = 3: must be a table"),
    ({"limits": 3}, "limits = 3: must be a table"),
    ({"phases": [3]}, "phases[0] = 3: must be a table"),
    (
        {"world": {"surfaces": [{"name": "a", "shape": "pyramid"}]}},
        (
            "world.surfaces[0].shape = 'pyramid': must be one of plane, box, cylinder,"
            " sphere, hole, capsule, hull, heightfield"
        ),
    ),
    (
        {"phases__2__to__velocity": [1.0, 0, 0]},
        "phases[2].to.velocity = [1.0, 0.0, 0.0]: must be left out beside rest",
    ),
    (
        {"phases__0__to__tip_axis": [0, 0, 0]},
        (
            "phases[0].to.tip_axis = (0.0, 0.0, 0.0): must be a unit vector, its length"
            " is 0"
        ),
    ),
]
"""Changes of a task that is right, and the message behind the file's name."""


@pytest.mark.parametrize(
    ("changes", "message"), WRONG, ids=[message.split(":")[0] for _, message in WRONG]
)
def test_a_wrong_task_is_refused_in_one_line(
    tmp_path: Path, changes: dict[str, Any], message: str
) -> None:
    file = tmp_path / "task.toml"
    file.write_text(toml_text(reach(**changes)), encoding="utf-8")
    with pytest.raises(TaskError) as refused:
        load_task(file)
    assert str(refused.value) == f"{file}: {message}"
    assert "\n" not in message


def test_the_task_that_the_wrong_ones_change_is_right(tmp_path: Path) -> None:
    file = tmp_path / "task.toml"
    file.write_text(toml_text(reach()), encoding="utf-8")
    assert load_task(file) == task_from(reach())
    assert load_task(str(file)).name == "reach"


@pytest.mark.parametrize("name", list_tasks())
def test_shipped_tasks_are_read(name: str) -> None:
    assert load_task(name).name == name


def test_files_that_are_none(tmp_path: Path) -> None:
    allowed = f"must be a .toml file or one of {', '.join(list_tasks())}"
    for path, message in (
        ("eagle", f"task = 'eagle': {allowed}"),
        ("task.json", f"task = 'task.json': {allowed}"),
        (tmp_path / "none.toml", f"task = '{tmp_path}/none.toml': "),
        (tmp_path, f"task = '{tmp_path}': {allowed}"),
    ):
        with pytest.raises(TaskError) as refused:
            load_task(path)
        assert str(refused.value).startswith(message)
        assert "\n" not in str(refused.value)
    broken = tmp_path / "broken.toml"
    broken.write_bytes(b"name = \n")
    with pytest.raises(TaskError, match=r"broken\.toml: .*line 1"):
        load_task(broken)


def test_a_vehicle_is_a_file_beside_the_task(tmp_path: Path) -> None:
    import skyarm.vehicle.vehicle_files as files

    library = Path(files.__file__).parent / "library"
    (tmp_path / "mine.toml").write_bytes(
        (library / "hexacopter370_flying_arm_3.toml").read_bytes()
    )
    file = tmp_path / "task.toml"
    file.write_text(toml_text(reach(vehicle="mine.toml")), encoding="utf-8")
    assert load_task(file).vehicle == task_from(reach()).vehicle


def test_a_vehicle_s_name_that_no_file_can_have_is_one_line(tmp_path: Path) -> None:
    task = tmp_path / "long.toml"
    task.write_text(
        f'vehicle = "{"A" * 300}"\n[[phases]]\nto = {{ base = [0.0, 0.0, 1.0], rest ='
        " true }\n"
    )
    with pytest.raises(
        TaskError, match=r"long\.toml: vehicle = 'AAA.*must be one of "
    ) as refused:
        load_task(task)
    assert "\n" not in str(refused.value)
