"""Wrong input at the command line: one line on standard error, exit code 2, no
traceback, nothing flown.
"""

from __future__ import annotations

import linecache
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_files import CASE1, VEHICLE, changed
from matplotlib.figure import Figure

from skyarm.cli.lines import say
from skyarm.records.files import needs_extra
from skyarm.records.files.user_code import PACKAGE
from skyarm.scenario.scenario_file import list_scenarios
from skyarm.vehicle.vehicle_files import LIBRARY as VEHICLES
from support.commands import refused, skyarm


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def written(folder: Path, text: str, name: str = "flight.toml") -> str:
    (folder / name).write_text(text)
    return name


BASE = (
    'name = "f"\nduration ='
    " 0.1\n[controller]\n{controller}\n[plant]\n{plant}\n[model]\nvehicle ="
    ' "hummingbird_arm2"\n'
)
LAW = 'law = "hybrid_computed_torque"'
PLANT = 'vehicle = "hummingbird_arm2_rotors"'


def small(controller: str = LAW, plant: str = PLANT, more: str = "") -> str:
    return BASE.format(controller=controller, plant=plant) + more


SCENARIO_ERRORS: list[tuple[str, str, tuple[str, ...]]] = [
    (
        "preset and law",
        small(controller='preset = "paper_ct"\nlaw = "centroidal"'),
        (
            (
                "controller.preset = 'paper_ct': must be left out beside law ="
                " 'centroidal', or law beside it"
            ),
        ),
    ),
    (
        "preset of two joints",
        small(
            controller='preset = "paper_ct"', plant='vehicle = "hexarotor_arm6"'
        ).replace('vehicle = "hummingbird_arm2"', 'vehicle = "hexarotor_arm6"'),
        (
            "does not fit this model",
            "law = 'hybrid_computed_torque' has some for any, or takes yours",
        ),
    ),
    (
        "unknown field",
        CASE1 + "\n[extra]\n",
        ("extra", "unknown field", "allowed", "duration"),
    ),
    (
        "unknown field in a table",
        small(plant=PLANT + "\nmass = 3"),
        ("plant.mass = 3", "unknown field", "gravity"),
    ),
    (
        "unknown vehicle",
        small(plant='vehicle = "nope"'),
        ("plant.vehicle = 'nope'", "hummingbird_arm2_rotors"),
    ),
    (
        "missing vehicle file",
        small(plant='vehicle = "gone/x.toml"'),
        ("plant.vehicle = 'gone/x.toml'", "no such file"),
    ),
    (
        "planar vehicle as plant",
        small(plant='vehicle = "hummingbird_arm2"'),
        ("plant.vehicle", "planar", "false"),
    ),
    (
        "other number of joints",
        small(plant='vehicle = "hummingbird"'),
        ("model.vehicle", "2 joints", "must have 0"),
    ),
    ("no name", changed(CASE1, 'name = "case1"', ""), ("name", "is missing")),
    (
        "a path as name",
        changed(CASE1, 'name = "case1"', 'name = "../up"'),
        ("name = '../up'", "letters, digits"),
    ),
    ("no duration", changed(CASE1, "duration = 30.0", ""), ("duration", "is missing")),
    (
        "negative duration",
        changed(CASE1, "duration = 30.0", "duration = -1.0"),
        ("duration = -1.0", "above 0"),
    ),
    (
        "no time at all",
        changed(CASE1, "duration = 30.0", "duration = 0"),
        ("duration = 0", "above 0"),
    ),
    (
        "endless",
        changed(CASE1, "duration = 30.0", "duration = inf"),
        ("duration = inf", "finite"),
    ),
    (
        "not a number",
        changed(CASE1, "duration = 30.0", "duration = nan"),
        ("duration = nan", "finite"),
    ),
    (
        "too long",
        changed(CASE1, "duration = 30.0", "duration = 1e9"),
        ("duration = 1000000000.0", "at most 50000"),
    ),
    (
        "half a period",
        changed(CASE1, "duration = 30.0", "duration = 0.0025"),
        ("duration = 0.0025", "control periods"),
    ),
    (
        "rates",
        changed(CASE1, "control = 200", "control = 300"),
        ("rates.control = 300", "divide rates.physics = 1000"),
    ),
    (
        "reference rate",
        changed(CASE1, "reference = 50 ", "reference = 60 "),
        ("rates.reference = 60", "divide"),
    ),
    (
        "zero rate",
        changed(CASE1, "control = 200", "control = 0"),
        ("rates.control = 0", "at least 1"),
    ),
    (
        "rate as text",
        changed(CASE1, "control = 200", 'control = "fast"'),
        ("rates.control = 'fast'", "whole number"),
    ),
    ("seed", "seed = -1\n" + CASE1, ("seed = -1", "0 to 2**32 - 1")),
    ("seed as float", "seed = 1.5\n" + CASE1, ("seed = 1.5", "whole number")),
    (
        "plant kind",
        changed(CASE1, "gravity = 9.8 ", 'kind = "gazebo"\ngravity = 9.8 '),
        ("plant.kind = 'gazebo'", "mujoco"),
    ),
    (
        "integrator",
        small(plant=PLANT + '\nintegrator = "rk5"'),
        ("plant.integrator = 'rk5'", "rk4, euler"),
    ),
    (
        "gravity",
        changed(CASE1, "gravity = 9.8 ", "gravity = -9.8 "),
        ("plant.gravity = -9.8", "at least 0"),
    ),
    (
        "preset",
        changed(CASE1, '"paper_ct"', '"paper_lqr"'),
        ("controller.preset = 'paper_lqr'", "paper_pd"),
    ),
    ("law", small('law = "mpc"'), ("controller.law = 'mpc'", "nmpc")),
    (
        "mixer",
        small(LAW + '\nmixer = "qp"'),
        ("controller.mixer = 'qp'", "clip, priority"),
    ),
    (
        "rate error",
        small(LAW + '\nrate_error = "x"'),
        ("controller.rate_error = 'x'", "rotors_sim, corrected"),
    ),
    (
        "ablation",
        small(LAW + '\nwithout = ["mass"]'),
        ("controller.without = ['mass']", "coriolis"),
    ),
    (
        "nothing to leave out",
        small('law = "decoupled_pd"\nwithout = ["coriolis"]'),
        ("controller.without", "no such option"),
    ),
    (
        "no controller",
        small(""),
        ("controller: must have a preset", "'skyarm show' shows all"),
    ),
    (
        "a law as preset",
        small('preset = "centroidal"'),
        ("controller.preset = 'centroidal'", "law = 'centroidal'"),
    ),
    (
        "a preset as law",
        small('law = "centroidal_tip"'),
        ("controller.law = 'centroidal_tip'", "preset = 'centroidal_tip'"),
    ),
    (
        "options of a preset",
        small('preset = "centroidal_tip"\nmode = "tip"'),
        ("controller.mode = 'tip'", "only safety"),
    ),
    (
        "exact mixer",
        small('law = "centroidal"\nmixer = "priority"'),
        ("controller.mixer = 'priority'", "has mode, delay"),
    ),
    (
        "exact gains",
        small('law = "centroidal"\ngains = { position = 3 }'),
        ("controller.gains = {", "tip, observer"),
    ),
    (
        "exact tip table",
        small('law = "centroidal"\ntip = { position = 1.0 }'),
        ("controller.tip = {'pos", "2 numbers"),
    ),
    (
        "exact tuned",
        small('law = "centroidal"\ntuned = true'),
        ("controller.tuned = True", "no such option"),
    ),
    (
        "other clock",
        small('law = "centroidal"\ncontrol_period = 0.01'),
        ("controller.control_period = 0.01", "0.005 s"),
    ),
    (
        "python's word",
        small('law = "indi"\nmixer_policy = "priority"'),
        ("controller.mixer_policy", "mixer, cutoff"),
    ),
    (
        "a maker's own word",
        small('law = "indi"\nname = "x"'),
        ("controller.name = 'x'", "no such option"),
    ),
    (
        "a model as option",
        small('law = "centroidal"\nmodel = 3'),
        ("controller.model = 3", "no such option"),
    ),
    (
        "cut-off",
        small('law = "indi"\ncutoff = 100.0'),
        ("controller.cutoff = 100.0", "below 100 Hz"),
    ),
    (
        "guarded cut-off",
        small('law = "indi"\ncutoff = 1e9\nsafety = true'),
        ("controller.cutoff", "below 100 Hz"),
    ),
    (
        "weights",
        small('law = "nmpc"\nweights = { tools = 1.0 }'),
        ("controller.weights.tools = 1.0", "tool"),
    ),
    (
        "negative weight",
        small('law = "nmpc"\nweights = { tool = -1.0 }'),
        ("controller.weights.tool = -1.0", "least"),
    ),
    (
        "a network",
        small('law = "learned_compensator"\nnetwork = "x"'),
        ("controller.network", "answer"),
    ),
    (
        "title",
        small(plant=PLANT).replace('name = "f"', 'name = "f"\ntitle = 3'),
        ("title = 3: must be text",),
    ),
    (
        "large seed",
        "seed = 4294967296\n" + CASE1,
        ("seed = 4294967296", "0 to 2**32 - 1"),
    ),
    (
        "joint gains",
        small(LAW + "\njoint_gains = { stiffness = [1, 2, 3], damping = [1, 2] }"),
        ("controller.joint_gains.stiffness", "3 values", "must be 2"),
    ),
    (
        "gain not a number",
        small(LAW + "\njoint_gains = { stiffness = [1, nan], damping = [1, 2] }"),
        ("controller.joint_gains.stiffness[1] = nan", "finite"),
    ),
    (
        "negative gain",
        small(
            LAW
            + "\n[controller.gains]\nposition = [4,4,-4]\nvelocity = [2,2,2]\nattitude"
            " = [1,1,1]\nrate = [1,1,1]"
        ),
        ("controller.gains.position.z = -4.0", "at least 0"),
    ),
    (
        "reference kind",
        changed(CASE1, '"hover"', '"figure8"'),
        ("reference.base.kind = 'figure8'", "hover, circle"),
    ),
    (
        "signal kind",
        changed(CASE1, '"sequence"', '"chirp"'),
        ("reference.joints[0].kind = 'chirp'", "sine"),
    ),
    (
        "one signal only",
        small(more="[reference]\njoints = [0.1]"),
        ("reference.joints = 1 signals", "list of 2"),
    ),
    (
        "wind mode",
        small(more='[environment.wind]\nmode = "gusty"'),
        ("environment.wind.mode = 'gusty'", "moving_air"),
    ),
    (
        "measurement delay",
        small(more="[delays]\nmeasurement = 0.004"),
        ("delays.measurement = 0.004", "control periods"),
    ),
    (
        "command delay",
        small(more="[delays]\ncommand = 0.0015"),
        ("delays.command = 0.0015", "physics steps"),
    ),
    (
        "delay beyond the flight",
        small(more="[delays]\ncommand = 1.0"),
        ("delays.command = 1.0", "not exceed"),
    ),
    (
        "sensor noise",
        small(more="[sensors]\nposition = -0.1"),
        ("sensors.position = -0.1", "at least 0"),
    ),
    (
        "attitude",
        small(more="[initial]\nquaternion_wxyz = [1.0, 0.0, 0.002, 0.0]"),
        ("initial.quaternion_wxyz = [1.0, 0.0, 0.002, 0.0]", "length 1 within 1e-06"),
    ),
    (
        "initial joints",
        small(more="[initial]\njoints = [0.1]"),
        ("initial.joints", "1 values", "must be 2"),
    ),
    (
        "payload frame",
        small(plant=PLANT + '\npayload = { mass = 0.1, frame = "hook" }'),
        ("plant.payload", "hook", "tip"),
    ),
    (
        "payload mass",
        small(plant=PLANT + "\npayload = { mass = -0.1 }"),
        ("plant.payload.mass = -0.1", "at least 0"),
    ),
    (
        "stiff friction",
        small(plant=PLANT + "\njoints = { coulomb = 0.1, coulomb_rate = 1e-4 }"),
        (
            "plant.vehicle = 'hummingbird_arm2_rotors'",
            "joints[joint2].coulomb = 0.1",
            "1/s",
            "raise coulomb_rate",
        ),
    ),
    (
        "stiff damping",
        small(plant=PLANT + '\nkind = "mujoco"\njoints = { damping = 1.0 }'),
        (
            "plant.vehicle = 'hummingbird_arm2_rotors'",
            "joints[joint2].damping = 1.0",
            "lower damping",
        ),
    ),
    ("schema", changed(CASE1, "schema = 1", "schema = 2"), ("schema = 2", "must be 1")),
    ("empty file", "", ("is missing",)),
    ("no TOML", "name = = 3", ("TOML", "line 1")),
    ("nested too deep", "x = " + "[" * 5000 + "]" * 5000, ("deep",)),
]


@pytest.mark.parametrize(
    ("text", "words"),
    [row[1:] for row in SCENARIO_ERRORS],
    ids=[row[0] for row in SCENARIO_ERRORS],
)
def test_a_wrong_scenario_is_one_line_with_file_field_value_and_what_is_allowed(
    folder: Path, text: str, words: tuple[str, ...]
) -> None:
    refused(skyarm("run", written(folder, text)), "flight.toml: ", *words)
    assert not (folder / "out").exists(), (
        "nothing may be made before the scenario is understood"
    )


VEHICLE_ERRORS: list[tuple[str, str, str, tuple[str, ...]]] = [
    ("negative mass", "mass = 0.68", "mass = -0.68", ("mass = -0.68", "at least 0")),
    ("mass not a number", "mass = 0.68", "mass = nan", ("mass = nan", "finite")),
    ("unknown field", "schema = 1", "schema = 1\ncolour = 3", ("colour", "unknown")),
    (
        "planar",
        'name = "link1"',
        'planar = true\nname = "link1"',
        ("links[link1].planar", "false"),
    ),
]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [row[1:] for row in VEHICLE_ERRORS],
    ids=[row[0] for row in VEHICLE_ERRORS],
)
def test_a_wrong_vehicle_of_a_scenario_names_both_files(
    folder: Path, old: str, new: str, words: tuple[str, ...]
) -> None:
    written(folder, changed(VEHICLE, old, new), "mine.toml")
    name = written(folder, changed(CASE1, '"hummingbird_arm2_rotors"', '"mine.toml"'))
    refused(skyarm("run", name), "flight.toml: plant.vehicle = ", *words)


def test_an_inertia_no_body_has_is_refused_in_a_plant(folder: Path) -> None:
    written(folder, _first_link_inertia(VEHICLE), "thin.toml")
    refused(
        skyarm("show", "thin.toml"), "thin.toml: ", "inertia", "triangle inequality"
    )
    name = written(folder, changed(CASE1, '"hummingbird_arm2_rotors"', '"thin.toml"'))
    refused(
        skyarm("run", name),
        "flight.toml: plant.vehicle = 'thin.toml'",
        "triangle inequality",
    )


def _first_link_inertia(text: str) -> str:
    at = text.index('name = "link1"')
    start = text.index("inertia = [", at)
    return (
        text[:start]
        + "inertia = [1e-6, 9e-5, 1e-6]"
        + text[text.index("]", start) + 1 :]
    )


def test_a_joint_without_an_axis_is_refused(folder: Path) -> None:
    lines = VEHICLE.splitlines()
    axis = next(i for i, line in enumerate(lines) if line.startswith("axis = "))
    written(folder, "\n".join(lines[:axis] + lines[axis + 1 :]), "axis.toml")
    refused(skyarm("show", "axis.toml"), "axis.toml: ", "axis")
    lines[axis] = "axis = [0.0, 0.0, 0.0]"
    written(folder, "\n".join(lines), "axis.toml")
    refused(skyarm("show", "axis.toml"), "axis.toml: ", "axis", "zero")


def test_a_quaternion_off_unit_length_in_a_vehicle_is_refused(folder: Path) -> None:
    text = changed(
        VEHICLE,
        "[links.joint]",
        "[links.joint]\nquaternion_wxyz = [1.0, 0.0, 0.0, 0.01]",
    )
    written(folder, text, "turned.toml")
    refused(
        skyarm("show", "turned.toml"), "turned.toml: ", "quaternion_wxyz", "unit length"
    )


def test_rotors_that_do_not_span_torque_and_thrust_are_refused(folder: Path) -> None:
    lined = VEHICLE
    for line in VEHICLE.splitlines():
        if line.startswith("position = [0.0, 0.17") or line.startswith(
            "position = [0.0, -0.17"
        ):
            lined = lined.replace(line, "position = [0.0, 0.0, 0.01]")
    assert lined != VEHICLE
    written(folder, lined, "line.toml")
    refused(skyarm("show", "line.toml"), "line.toml: ", "rank 3", "must be 4")
    name = written(folder, changed(CASE1, '"hummingbird_arm2_rotors"', '"line.toml"'))
    refused(skyarm("run", name), "flight.toml: plant.vehicle = ", "rank 3", "must be 4")
    believed = changed(
        CASE1, 'vehicle = "hummingbird_arm2"\n', 'vehicle = "line.toml"\n'
    )
    refused(
        skyarm("run", written(folder, believed)),
        "flight.toml: model.vehicle = ",
        "rank 3",
        "must be 4",
    )


@pytest.mark.parametrize(
    "what", ["missing.toml", "case9", "nothing/at/all.toml", "", "case1.yaml"]
)
def test_a_scenario_that_does_not_exist_names_the_shipped_ones(
    folder: Path, what: str
) -> None:
    refused(skyarm("run", what), f"scenario = {what!r}", "case1", "case3_wind")


@pytest.mark.parametrize("command", ["run", "show"])
@pytest.mark.parametrize("ending", ["", ".toml"])
def test_a_name_of_five_thousand_letters_is_one_short_line(
    folder: Path, command: str, ending: str
) -> None:
    outcome = skyarm(command, "a" * 5000 + ending)
    refused(outcome, "aaa...", "must be" if not ending else "too long")
    assert len(outcome.err) < 200 + len(", ".join(list_scenarios()))
    assert "[Errno" not in outcome.err


def test_a_byte_order_mark_is_no_error(folder: Path) -> None:
    (folder / "mine.toml").write_bytes(b"\xef\xbb\xbf" + VEHICLE.encode())
    flight = changed(CASE1, '"hummingbird_arm2_rotors"', '"mine.toml"')
    (folder / "flight.toml").write_bytes(b"\xef\xbb\xbf" + flight.encode())
    assert skyarm("show", "mine.toml").code == 0
    assert skyarm("run", "flight.toml", "--duration", "0.01").code == 0


HUGE = [
    (
        "thrust_coefficient = 8.54858e-6",
        "thrust_coefficient = 1e300",
        ("thrust_coefficient = 1e+300", "at most 1e+12"),
    ),
    (
        "position = [0.17, 0.0, 0.01]",
        "position = [1e200, 0.0, 0.01]",
        ("rotors[front].position.x = 1e+200", "at most"),
    ),
    (
        "position = [0.0, 0.0, -0.15]",
        "position = [0.0, 0.0, -1e200]",
        ("position.z = -1e+200", "at most 1e+07 in size"),
    ),
]


@pytest.mark.parametrize(("old", "new", "words"), HUGE, ids=["thrust", "rotor", "link"])
def test_rotors_beyond_numbers_are_one_line(
    folder: Path, old: str, new: str, words: tuple[str, ...]
) -> None:
    """Warnings are errors in the tests: a warning of NumPy on the way would end in a
    traceback.
    """
    written(folder, changed(VEHICLE, old, new), "mine.toml")
    name = written(folder, changed(CASE1, '"hummingbird_arm2_rotors"', '"mine.toml"'))
    refused(skyarm("show", "mine.toml"), "mine.toml: ", *words)
    refused(skyarm("run", name), "flight.toml: plant.vehicle = ", *words)


def test_a_base_too_heavy_for_numbers_is_blamed_for_its_mass(folder: Path) -> None:
    planar = (VEHICLES / "hummingbird_arm2.toml").read_text("utf-8")
    heavy = re.sub(
        r"mass = \S+", "mass = 1e308\ncom = [0.0, 0.0, 0.1]", planar, count=1
    )
    written(folder, heavy, "heavy.toml")
    refused(
        skyarm("show", "heavy.toml"), "heavy.toml: base.mass = 1e+308", "at most 1e+09"
    )


def test_a_law_or_preset_that_does_not_fit_the_vehicle_is_named(folder: Path) -> None:
    three = VEHICLE.replace("[rotor_defaults]", THIRD_LINK + "[rotor_defaults]", 1)
    written(folder, three, "three.toml")
    plant = (
        'name = "f"\nduration = 0.1\n[plant]\nvehicle = "three.toml"\n[controller]\n'
    )
    for controller, words in (
        (
            'preset = "paper_ct"',
            ("controller.preset = 'paper_ct'", "2 values, must be 3"),
        ),
        ('law = "ct_observer"', ("controller.law = 'ct_observer'", "must be one of")),
        (
            'law = "learned_compensator"',
            ("controller.network: takes 39 inputs", "a vehicle of 3 joints gives 45"),
        ),
    ):
        refused(
            skyarm("run", written(folder, plant + controller)), "flight.toml: ", *words
        )


THIRD_LINK = """
[[links]]
name = "link3"
parent = "link2"
mass = 0.04
com = [0.0, 0.0, -0.075]
inertia = [7.5e-5, 7.5e-5, 5e-7]
[links.joint]
name = "joint3"
axis = [0.0, 1.0, 0.0]
position = [0.0, 0.0, -0.15]
"""


def test_a_folder_given_as_scenario_is_refused(folder: Path) -> None:
    (folder / "dir.toml").mkdir()
    refused(skyarm("run", "dir.toml"), "dir.toml", "is a folder")
    refused(skyarm("show", "dir.toml"), "dir.toml", "is a folder")
    (folder / "plain").mkdir()
    refused(skyarm("run", "plain"), "plain", ".toml")


@pytest.mark.parametrize(
    "content",
    [bytes(range(256)), b"\xff\xfe\x00", b"\x00" * 100, b"\x93NUMPY\x01\xff\n[x]"],
)
def test_binary_garbage_is_refused_as_scenario_and_vehicle(
    folder: Path, content: bytes
) -> None:
    (folder / "garbage.toml").write_bytes(content)
    refused(skyarm("run", "garbage.toml"), "garbage.toml: ", "must be")
    refused(skyarm("show", "garbage.toml"), "garbage.toml: ")


@pytest.mark.parametrize("command", [["run", "case1"], ["reproduce"]])
def test_an_output_folder_that_cannot_be_written_is_refused_before_any_flight(
    folder: Path, command: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (folder / "taken").write_text("a file in place of the folder")

    def flown(*_: Any, **__: Any) -> None:
        raise AssertionError("flown before the folder was checked")

    monkeypatch.setattr("skyarm.simulate.run", flown)
    monkeypatch.setattr("skyarm.paper.reproduce.run_campaign", flown)
    for out in ("taken", "taken/inner"):
        refused(
            skyarm(*command, "--out", out),
            f"output folder = '{out}",
            "must be writable",
        )
    (folder / "half").mkdir()
    (folder / "half" / "figures").write_text("in the way")
    if command == ["reproduce"]:
        refused(
            skyarm(*command, "--out", "half"),
            "output folder = 'half/figures'",
            "must be writable",
        )
    files = (
        ("case1.npz", "case1.csv")
        if command[0] == "run"
        else ("report.html", "figures/figure_18.png")
    )
    for number, file in enumerate(files):
        (folder / f"named{number}" / file).mkdir(parents=True)
        refused(
            skyarm(*command, "--out", f"named{number}"),
            f"named{number}/{file}",
            "there is a folder of this name",
        )


@pytest.mark.parametrize("command", [["run", "case1"], ["reproduce"]])
def test_an_output_folder_without_a_name_is_refused(
    folder: Path, command: list[str]
) -> None:
    refused(
        skyarm(*command, "--out", ""),
        "output folder = ''",
        "must be the path of a folder",
    )
    assert not list(folder.iterdir())


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["bogus"], ("bogus",)),
        (["--bogus"], ("--bogus",)),
        (["run"], ("Missing argument",)),
        (["run", "case1", "--seed", "x"], ("--seed", "valid")),
        (["run", "case1", "--duration", "long"], ("--duration", "valid")),
        (["run", "case1", "--nope"], ("--nope",)),
        (["run", "case1", "case2"], ("case2",)),
        (["reproduce", "--workers"], ("--workers",)),
        (["reproduce", "--workers", "-1"], ("--workers = -1", "from 0 to")),
        (
            ["reproduce", "--plant", "gazebo"],
            ("--plant = 'gazebo'", "rigid_body, mujoco, both"),
        ),
        (["run", "case1", "--plant", "gazebo"], ("'gazebo'", "rigid_body, mujoco")),
        (["run", "case1", "--laws", "lqr"], ("'lqr'", "paper_pd")),
        (["run", "case1", "--seed", "-1"], ("seed = -1", "from 0")),
        (["run", "case1", "--duration", "-1"], ("duration = -1.0", "above 0")),
        (["run", "case1", "--duration", "nan"], ("duration = nan", "finite")),
        (["sweep", ""], ("study = ''", "shipped studies are")),
        (["margins", ""], ("scenario = ''", "shipped scenarios are")),
        (["compare", ""], ("suite = ''", "paper-suite")),
        (["run", ""], ("scenario = ''", "shipped scenarios are")),
        (["show", ""], ("vehicle = ''", "hexarotor_arm6")),
        (["export", "--to", "c", "", "-o", "x.c"], ("controller = ''", "paper_ct")),
        (
            ["export", "--to", "c", "paper_ct", "-o", ""],
            ("--out = ''", "path of a file"),
        ),
        (
            ["export", "--to", "c", "case1", "-o", "x.py"],
            ("--out = 'x.py': must end in .c",),
        ),
        (
            ["export", "--to", "mjcf", "case1", "-o", "x.c"],
            ("--out = 'x.c': must end in .xml or .mjcf",),
        ),
        (["--plugin", "", "show"], ("--plugin: must be followed by a .py file",)),
        (["show", "nope"], ("vehicle = 'nope'", "hexarotor_arm6")),
        (["show", "nope.urdf"], ("nope.urdf", "no such file")),
        (["show", "hummingbird", "--gravity", "nan"], ("--gravity = nan", "finite")),
        (["show", "hummingbird", "--gravity", "0"], ("--gravity = 0.0", "above 0")),
    ],
)
def test_wrong_arguments_are_one_line(
    folder: Path, arguments: list[str], words: tuple[str, ...]
) -> None:
    refused(skyarm(*arguments), *words)
    assert not list(folder.iterdir())


def test_an_unexpected_error_inside_is_not_dressed_up_as_wrong_input(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def broken(*_: Any) -> None:
        raise ZeroDivisionError("a bug")

    monkeypatch.setattr("skyarm.cli.show_command.load_vehicle", broken)
    ended = skyarm("show", "hummingbird", "--json")
    assert (ended.code, ended.out) == (70, "")
    said = (
        "skyarm: an error of skyarm, please report it with the output of --debug:"
        " ZeroDivisionError at "
    )
    assert re.fullmatch(
        rf"{re.escape(said)}test_cli_errors\.py:\d+: a bug\n", ended.err
    )
    debugged = skyarm("show", "hummingbird", "--debug")
    assert debugged.code == 70
    assert debugged.err.startswith("Traceback")
    assert debugged.err.endswith(ended.err)


@pytest.mark.parametrize(
    ("place", "text"),
    [
        ("skyarm.cli.show_command.vehicle_facts", "float('12,5')"),
        ("skyarm.cli.show_command.say_unlikely", "np.zeros(2) + np.zeros(3)"),
        (
            "skyarm.cli.show_command.sheet",
            "Figure().subplots().plot([1.0, 2.0], [1.0])",
        ),
    ],
)
def test_an_error_of_a_library_that_reaches_the_user_is_ours(
    monkeypatch: pytest.MonkeyPatch, place, text
) -> None:
    """A ValueError of Matplotlib or NumPy says nothing about the input."""
    code = compile(f"def broken(*_):\n    {text}\n", f"{PACKAGE}broken.py", "exec")
    names: dict[str, Any] = {"np": np, "Figure": Figure}
    exec(code, names)
    linecache.cache[f"{PACKAGE}broken.py"] = (
        0,
        None,
        ["def broken(*_):\n", f"    {text}\n"],
        "",
    )
    monkeypatch.setattr(place, names["broken"])
    ended = skyarm("show", "hummingbird")
    assert ended.code == 70
    assert ended.err.count("\n") == 1
    assert "please report it" in ended.err


def test_a_missing_optional_library_is_named_with_its_extra(tmp_path, monkeypatch):
    (tmp_path / "cmaes.py").write_text("raise ImportError('no cmaes here')\n")
    words = [sys.executable, "-m", "skyarm", "tune", "case1"]
    hiding = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(
            [str(tmp_path), os.environ.get("PYTHONPATH", "")]
        ),
    }
    done = subprocess.run(
        words,
        capture_output=True,
        text=True,
        timeout=120,
        env=hiding,
        check=False,
        cwd=tmp_path,
    )
    assert (done.returncode, done.stdout) == (2, "")
    # the command names a checkout's folder unless it runs there
    monkeypatch.chdir(tmp_path)
    assert done.stderr == f"skyarm: {needs_extra('tune')}\n"


def test_no_line_is_longer_than_a_message(capsys: pytest.CaptureFixture[str]) -> None:
    assert say(f"begin {'a word ' * 300}end", 2) == 2
    line = capsys.readouterr().err
    assert line.startswith("skyarm: begin a word")
    assert line.endswith("a word end\n")
    assert 900 < len(line) <= 1001
