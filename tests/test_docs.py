"""What the pages under docs show is true: their examples load, run and fly, and the
choices there are stand on them.
"""

import dataclasses
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

import skyarm
from skyarm.control.blocks.geometric import RATE_ERRORS
from skyarm.control.catalogue import PRESETS
from skyarm.control.model import Terms
from skyarm.log.flight_log import IF_ANY
from skyarm.log.log_columns import columns
from skyarm.records.identity import identity
from skyarm.records.registry.shipped import SHIPPED
from support.pages import rows_of
from website.generated_blocks import made

DOCS = Path(__file__).resolve().parents[1] / "docs"


def page(name):
    return (DOCS / name).read_text(encoding="utf-8")


def blocks(name, language):
    return re.findall(rf"```{language}\n(.*?)```", page(name), re.DOTALL)


def example():
    """The complete example to which the page on scenario files links."""
    assert "(../examples/files/every_table.toml)" in page("scenario_files.md")
    return (DOCS.parent / "examples" / "files" / "every_table.toml").read_text("utf-8")


def test_the_scenario_shown_loads_and_flies(tmp_path):
    text = example()
    path = tmp_path / "flight.toml"
    path.write_text(text, encoding="utf-8")
    log = skyarm.run(skyarm.load_scenario(path, duration=1.0))
    assert log.status == "completed"
    assert log.time.size == 200
    # it starts 0.1 m beside its reference
    assert np.abs(log.position[0] - [0.1, 0.0, 2.0]).max() < 1e-3


def test_the_scenario_shown_says_what_its_comments_say():
    document = tomllib.loads(example())
    scenario = skyarm.scenario_from(document)
    truth, belief = scenario.plant.vehicle, scenario.controller.par.model.vehicle
    assert float(truth.mass) == pytest.approx(
        float(skyarm.load_vehicle("hummingbird_arm2_rotors").mass) + 0.02
    )
    assert float(belief.mass) == pytest.approx(
        float(skyarm.load_vehicle("hummingbird_arm2").mass)
    )
    assert {float(link.joint.damping) for link in truth.links} == {0.002}
    # circle at its right-most point 2 m up, raised by 0.5 m from 5 to 7 s
    assert [float(c) for c in scenario.reference.at(2.0).position] == pytest.approx(
        [0.3, 0.0, 2.0]
    )
    assert float(scenario.reference.at(7.5).position.z) == pytest.approx(2.5)


def test_every_table_of_a_scenario_is_in_the_example():
    document = tomllib.loads(example())
    top = (
        page("scenario_files.md")
        .split("<!-- generated: words top ")[1]
        .split("<!-- /generated -->")[0]
    )
    tables = set(re.findall(r"^\| `(\w+)` \| table", top, re.MULTILINE))
    # on pages or in sections of their own
    others = {
        "agents",
        "estimator",
        "payloads",
        "world",
        "team",
        "endings",
        "plugins",
        "numbers",
    }
    assert others < tables
    assert tables - others == {
        name for name, value in document.items() if isinstance(value, dict)
    } | {"changes"}


def test_the_parts_of_the_page_say_what_their_comments_say():
    """The sine of a joint begins at 2 s, and the wind changes at 12 s, in the examples
    of their sections, too.
    """
    sine, change = (
        tomllib.loads(
            next(each for each in blocks(name, "toml") if each.startswith(head))
        )
        for name, head in (
            ("scenario_reference.md", "[[reference.joints]]"),
            ("scenario_files.md", "[[changes]]"),
        )
    )
    whole = tomllib.loads(example())
    first, second = sine["reference"]["joints"]
    assert first == whole["reference"]["joints"][0]
    assert second == {"kind": "constant", "value": 0.0}
    assert skyarm.scenario_from(
        whole | {"reference": {"base": whole["reference"]["base"]} | sine["reference"]}
    )
    assert change["changes"] == whole["changes"]
    scenario = skyarm.scenario_from(whole)
    assert float(scenario.reference.at(1.9).joints[0]) == 0.0
    assert float(scenario.reference.at(2.5).joints[0]) == pytest.approx(0.2)


def test_every_choice_is_on_the_page():
    text = "".join(
        page(f"scenario_{name}.md") for name in ("files", "reference", "sensors")
    )
    kinds = [*SHIPPED["motion"], *SHIPPED["signal"]]
    fields = [
        field.name
        for record in (skyarm.Rates, skyarm.Delays, skyarm.SensorNoise)
        for field in dataclasses.fields(record)
    ]
    for name in (*kinds, *fields, *PRESETS, *SHIPPED["law"]):
        assert f"`{name}`" in text or f'`"{name}"`' in text, name


def test_every_choice_of_an_option_is_in_the_table_of_its_law():
    text = made("law hybrid_computed_torque")
    assert all(
        f'`"{name}"`' in text
        for name in (*RATE_ERRORS, *(field.name for field in dataclasses.fields(Terms)))
    )


def test_the_python_shown_runs(capsys):
    first, second, *_ = blocks("python_api.md", "python")
    assert len(first.strip().splitlines()) <= 32
    names = {}
    exec(compile(first, "python_api.md", "exec"), names)
    status, error = capsys.readouterr().out.split()
    assert status == "completed"
    # truth and belief are the same vehicle but for its friction: the tool of a 0.2 m
    # arm stays within 4 cm
    assert float(error) < 0.04
    exec(compile(second, "python_api.md", "exec"), names)
    errors = [float(line.split()[1]) for line in capsys.readouterr().out.splitlines()]
    assert len(errors) == 6
    assert errors[:3] == sorted(errors[:3]), "more friction, larger errors"
    assert names["late"].delays.command == 0.003
    assert names["noisy"].noise.position == 0.002
    assert (names["coarse"].kind, names["coarse"].rates.control) == ("mujoco", 100)
    assert names["late"].controller is names["scenario"].controller


def test_a_log_holds_what_the_page_says():
    log = skyarm.run(skyarm.load_scenario("case2", duration=0.1))
    rows = rows_of("log_arrays.md", "<!-- generated: log arrays -->")
    assert len(rows) > 15
    sizes = {
        "N": log.time.size,
        "joints": log.joints.shape[1],
        "rotors": log.rotor_speeds.shape[1],
    }
    listed = {each.name for each in columns(log)}
    for name, shape, *_, shown in rows:
        array = log.arrays()[name.strip("`")]
        assert array.shape == tuple(
            sizes[each] if each in sizes else int(each) for each in shape.split(", ")
        ), name
        for column in re.findall(r"`(\w+)`", shown):
            assert any(
                each.startswith(column.removesuffix("_JOINT").removesuffix("_ROTOR"))
                for each in listed
            ), column


def test_arrays_of_some_flights_are_on_the_page():
    rows = rows_of("log_arrays.md", "<!-- generated: log optional -->")
    told = {
        name
        for row in rows_of("log_arrays.md", "| array | there if |")
        for name in re.findall(r"`(\w+)`", row[0])
    }
    assert {row[0].strip("`") for row in rows} == set(IF_ANY) == told


def test_the_scenario_that_a_page_writes_is_read_with_its_digest(tmp_path, monkeypatch):
    (code,) = (
        each
        for each in blocks("scenario_files.md", "python")
        if "save_scenario" in each
    )
    monkeypatch.chdir(tmp_path)
    names = {}
    exec(code, names)
    assert identity(skyarm.load_scenario("out/heavier.toml")) == identity(
        names["heavier"]
    )


def test_the_parts_of_a_scenario_shown_are_read():
    """Tables of the pages on plant, world, sensors and reference, each in the
    example.
    """
    whole = tomllib.loads(example())
    for name in (
        "scenario_plant.md",
        "scenario_world.md",
        "scenario_sensors.md",
        "scenario_reference.md",
    ):
        (part, *_) = map(tomllib.loads, blocks(name, "toml"))
        for table, value in part.items():
            own = whole[table] if isinstance(value, dict) and table in whole else {}
            if table == "controller":
                own = {}
            assert skyarm.scenario_from(
                whole | {table: own | value if isinstance(value, dict) else value}
            )


@pytest.mark.parametrize("name", skyarm.__all__)
def test_every_public_name_is_there(name):
    assert getattr(skyarm, name) is not None


def test_import_stays_light():
    code = (
        "import sys, skyarm; print([m for m in sys.modules if m.startswith('skyarm.')"
        " or m in ('numpy', 'mujoco')])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize(
    "name", sorted(path.name for path in DOCS.rglob("*.md") if path.parent == DOCS)
)
def test_links_between_pages_lead_to_files(name):
    for target in re.findall(r"\]\(([^)#:]+)\)", page(name)):
        assert (DOCS / target).exists(), target
