"""Leaves of the house: what they import stands in one written list, and nobody loads
them who does not ask.

The import contract ``leaves`` of pyproject.toml says who may import a leaf;
``[tool.skyarm]`` there has the list.
"""

from __future__ import annotations

import ast
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest

import skyarm
from skyarm.records.registry.registrations import function_of_option
from skyarm.records.registry.shipped import OPTIONS, SECTIONS

ROOT = Path(__file__).resolve().parents[2]
SOURCE = Path(skyarm.__file__).parent
SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]
LEAVES: dict[str, list[str]] = SETTINGS["skyarm"]["leaves"]
INTERFACE: dict[str, list[str]] = SETTINGS["skyarm"]["developer-interface"]
ROOMS = [room for rooms in LEAVES.values() for room in rooms]


def is_inside(module: str, rooms: list[str]) -> bool:
    return f"{module}.".startswith(tuple(f"{room}." for room in rooms))


def is_module(name: str) -> bool:
    place = SOURCE.parent.joinpath(*name.split("."))
    return place.is_dir() or place.with_suffix(".py").is_file()


def imported(source: str) -> Iterator[tuple[int, str, str]]:
    """Line, module and name of all that a text takes from the library; of a module, the
    names that are read of it.
    """
    tree = ast.parse(source)
    modules: dict[str, str] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (
                (node.lineno, each.name, "*")
                for each in node.names
                if is_inside(each.name, ["skyarm"])
            )
        elif isinstance(node, ast.ImportFrom) and (
            node.level or is_inside(str(node.module), ["skyarm"])
        ):
            for each in node.names:
                if is_module(f"{node.module}.{each.name}"):
                    modules[each.asname or each.name] = f"{node.module}.{each.name}"
                else:
                    yield node.lineno, str(node.module), each.name
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.Attribute)
            and isinstance(node.value, ast.Name)
            and node.value.id in modules
        ):
            yield node.lineno, modules[node.value.id], node.attr


def taken_by(leaf: str) -> Iterator[tuple[str, str, str]]:
    """Place, module and name of all that the files of a leaf import from outside of
    it.
    """
    for path in sorted(SOURCE.rglob("*.py")):
        module = ".".join(("skyarm", *path.relative_to(SOURCE).with_suffix("").parts))
        if is_inside(module, LEAVES[leaf]):
            for line, other, name in imported(path.read_text("utf-8")):
                if not is_inside(other, LEAVES[leaf]):
                    yield f"{path.relative_to(SOURCE.parent)}:{line}", other, name


def refused(leaf: str) -> list[str]:
    """One line for each import of a leaf that is not in the list."""
    return [
        f"{place}: {module}.{name}: must be a name of [tool.skyarm.developer-interface]"
        f" in pyproject.toml, which has of {module}:"
        f" {', '.join(INTERFACE.get(module, [])) or 'none'}"
        for place, module, name in taken_by(leaf)
        if name not in INTERFACE.get(module, [])
    ]


@pytest.mark.parametrize("leaf", LEAVES)
def test_a_leaf_imports_only_names_of_the_developer_interface(leaf: str) -> None:
    assert refused(leaf) == []


def test_the_developer_interface_has_no_name_that_no_leaf_imports() -> None:
    taken = {(module, name) for leaf in LEAVES for _, module, name in taken_by(leaf)}
    assert {
        (module, name) for module, names in INTERFACE.items() for name in names
    } - taken == set()


def test_the_developer_interface_has_each_class_and_function_once() -> None:
    found: dict[int, str] = {}
    for module, names in INTERFACE.items():
        assert not is_inside(module, ROOMS)
        for name in names:
            thing = getattr(import_module(module), name)
            if callable(thing):
                assert (
                    found.setdefault(id(thing), f"{module}.{name}")
                    == f"{module}.{name}"
                )


def test_the_import_contract_protects_each_leaf() -> None:
    contracts = {each["id"]: each for each in SETTINGS["importlinter"]["contracts"]}
    assert sorted(contracts["leaves"]["protected_modules"]) == sorted(ROOMS)
    assert {*contracts["leaves"]["allowed_importers"]} <= {*ROOMS}


def test_what_the_registry_finds_in_a_leaf_is_there() -> None:
    commands = [
        location for section in SECTIONS.values() for location, _ in section.values()
    ]
    found = [
        each
        for each in (*commands, *OPTIONS.values())
        if is_inside(each.partition(":")[0], ROOMS)
    ]
    assert len(found) == len(OPTIONS) + 3
    assert all(callable(function_of_option(option)) for option in OPTIONS)


@pytest.mark.parametrize(
    ("source", "names"),
    [
        ("from skyarm.records.units import Unit", ["skyarm.records.units.Unit"]),
        (
            "def f():\n    from skyarm.records.units import Unit as U",
            ["skyarm.records.units.Unit"],
        ),
        (
            "from skyarm import dynamics as d\nd.energy(d.State)",
            ["skyarm.dynamics.energy", "skyarm.dynamics.State"],
        ),
        (
            "import skyarm.dynamics\nimport numpy\nfrom numpy import array",
            ["skyarm.dynamics.*"],
        ),
    ],
)
def test_every_way_to_import_a_name_is_seen(source: str, names: list[str]) -> None:
    assert [f"{module}.{name}" for _, module, name in imported(source)] == names


def loaded(program: str) -> set[str]:
    """Modules of leaves that a program has loaded in a process of its own."""
    lines = f"{program}\nimport sys; print('modules:', *sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", lines],
        capture_output=True,
        text=True,
        check=True,
        timeout=120.0,
    )
    modules = done.stdout.splitlines()[-1].split()
    assert "skyarm" in modules
    return {module for module in modules if is_inside(module, ROOMS)}


FREE = (
    'import skyarm; assert skyarm.run(skyarm.load_scenario("case3",'
    ' duration=0.1)).status == "completed"'
)


def test_the_library_and_a_free_flight_load_no_leaf() -> None:
    assert loaded("import skyarm") == set()
    assert loaded(FREE) == set()
    # the oracle: a name of the stub, and an autopilot's name in the registry, load
    # theirs
    assert "skyarm.flight_data.flight_data" in loaded(
        "import skyarm; skyarm.load_flight"
    )
    assert "skyarm.links.autopilots.px4" in loaded(
        "from skyarm.records.registry import find; find('autopilot', 'px4')"
    )


NIGHTLY = pytest.mark.thorough


@pytest.mark.parametrize(
    "words",
    [
        ["--help"],
        pytest.param(["run", "--help"], marks=NIGHTLY),
        ["show", "hummingbird"],
        pytest.param(["studio", "--help"], marks=NIGHTLY),
    ],
)
def test_commands_of_the_house_load_no_leaf(words: list[str]) -> None:
    program = (
        f"import sys; sys.argv = ['skyarm', *{words}]; from skyarm.cli.commands import"
        " perform; perform()"
    )
    assert loaded(program) == set()
