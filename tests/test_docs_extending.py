"""The pages on extending and on sessions are true: their code runs, and every kind that
can be registered is named. The examples that add a part fly it and print what they say.
"""

from __future__ import annotations

import ast
import dataclasses
import inspect
import io
import re
import runpy
import sys
import timeit
import tokenize
import tomllib
import types
from importlib import import_module, metadata
from pathlib import Path
from typing import Any

import pytest

import skyarm
from shown_commands import run_command
from skyarm.algebra import scalars
from skyarm.compile.llvm.lane_stepper import Quick
from skyarm.dynamics.point_motion import PointMotion
from skyarm.log.metrics.metric import MetricInstant
from skyarm.records.leaves import leaves
from skyarm.records.registry import KINDS, plugins
from skyarm.records.registry.contract import CONTRACTS
from skyarm.records.registry.plugins import load_plugin
from support.components import EVERYTHING, MAKERS, registry_kept

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
PAGE = (DOCS / "extending.md").read_text("utf-8")
FOLDER = ROOT / "examples"
EXAMPLES = sorted(FOLDER.glob("*.py"))
FLOWN = [path for path in EXAMPLES if "__main__" in path.read_text("utf-8")]
RECIPES = [path for path in FLOWN if "skyarm.register." in path.read_text("utf-8")]


def blocks(text: str, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)


def test_every_kind_that_can_be_registered_is_on_the_page() -> None:
    table = PAGE.partition("\n## ")[0]
    assert re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE) == list(KINDS)


def test_each_kind_that_can_be_registered_leads_to_an_example_or_a_page() -> None:
    table = PAGE.partition("\n## ")[0]
    rows = re.findall(r"^\| `(\w+)` \|.*\]\(([^)]+)\) \|$", table, re.MULTILINE)
    assert [kind for kind, _ in rows] == list(KINDS)
    shown = {FOLDER / Path(link).name for _, link in rows if "../examples/" in link}
    assert shown == {*RECIPES}
    for kind, link in rows:
        if "../examples/" in link:
            text = (FOLDER / Path(link).name).read_text("utf-8")
            assert f"skyarm.register.{kind}(" in text, link


def said(code: str) -> list[str]:
    """Comments behind the prints of an example, in their order."""
    lines = code.splitlines()
    ends = [
        node.end_lineno or 0
        for node in ast.walk(ast.parse(code))
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id == "print"
    ]
    return [lines[end - 1].partition("  # ")[2] for end in sorted(ends)]


@pytest.mark.parametrize("path", RECIPES, ids=lambda path: path.stem)
def test_a_recipe_flies_as_it_is_and_prints_what_stands_beside_its_prints(
    path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with registry_kept():
        runpy.run_path(str(path), run_name="__main__")
    assert capsys.readouterr().out.splitlines() == said(path.read_text("utf-8"))


@pytest.mark.parametrize("path", RECIPES, ids=lambda path: path.stem)
def test_a_recipe_is_a_plugin_that_flies_nothing_and_has_few_words(path: Path) -> None:
    with registry_kept():
        load_plugin(path)
    code = path.read_text("utf-8")
    kinds = (ast.Module, ast.ClassDef, ast.FunctionDef)
    words = [
        ast.get_docstring(node) or ""
        for node in ast.walk(ast.parse(code))
        if isinstance(node, kinds)
    ]
    words += [
        token.string
        for token in tokenize.generate_tokens(io.StringIO(code).readline)
        if token.type == tokenize.COMMENT
    ]
    assert len(re.findall(r"\S*\w\S*", " ".join(words))) <= 350


def flight_of(name: str, table: str = "FLIGHT") -> dict[str, Any]:
    """Table of a flight that an example states; its part is registered."""
    return tomllib.loads(vars(load_plugin(FOLDER / f"{name}.py"))[table])


def test_the_air_shown_flies_by_its_name() -> None:
    with registry_kept():
        needed = {"duration": 1.0, "plugins": {"need": ["own_wind.py"]}}
        log = skyarm.run(skyarm.scenario_from(flight_of("own_wind") | needed))
    assert log.status == "completed"
    assert log.air_velocity.std(axis=0).min() > 0.05


def test_the_fault_and_the_signal_shown_are_read_and_fly() -> None:
    with registry_kept():
        stated = flight_of("own_world_part", "TIRED") | {"duration": 0.1}
        scenario = skyarm.scenario_from(stated)
        fault = scenario.faults[0]
        assert (float(fault.share(0.0)), round(float(fault.share(9.0)), 6)) == (
            1.0,
            0.9,
        )
        assert len(scenario.reference.yaw.signals) == 2
        assert skyarm.run(scenario).status == "completed"
        yaw = stated["reference"]["yaw"] | {"phase": 1.0}
        with pytest.raises(ValueError, match=r"yaw\.phase = 1\.0: unknown"):
            skyarm.scenario_from(
                stated | {"reference": stated["reference"] | {"yaw": yaw}}
            )


@pytest.mark.parametrize(
    "kind", [kind for kind, contract in CONTRACTS.items() if contract.base]
)
def test_the_base_class_that_a_kind_names_is_there_and_on_the_page(kind: str) -> None:
    base = CONTRACTS[kind].base
    module, _, name = base.rpartition(".")
    assert isinstance(getattr(import_module(module), name), type)
    assert f"ubclass of {base}" in KINDS[kind]
    assert re.search(rf"^\| `{kind}` \|.*ubclass of `{base}`", PAGE, re.MULTILINE)


def files(language: str) -> dict[str, str]:
    """Files of the page by their titles."""
    return dict(
        re.findall(rf'```{language} title="([^"]+)"\n(.*?)```', PAGE, re.DOTALL)
    )


def rows_of(heading: str, text: str = PAGE) -> list[str]:
    """First cells of the table under a heading."""
    section = re.split(r"\n##+ ", text[text.index(f"## {heading}\n") :])[0]
    return re.findall(r"^\| (`.*?) \|", section, re.MULTILINE)


def test_the_functions_for_any_scalar_are_all_that_a_part_may_use() -> None:
    listed = [
        word
        for row in rows_of("Functions for any scalar")
        for word in re.findall(r"`(\w+)`", row)
    ]
    of_the_library = {
        "PYTHON_NUMBERS",
        "Scalar",
        "Scalars",
        "ScalarSequence",
        "register",
        "same",
        "structural",
    }
    assert sorted(listed) == sorted(set(scalars.__all__) - of_the_library)


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_what_an_example_sends_to_help_is_there(path: Path) -> None:
    for name in re.findall(r"help\(([\w.]+)\)", path.read_text("utf-8")):
        module, _, thing = name.rpartition(".")
        assert inspect.getdoc(getattr(import_module(module), thing))


def test_what_the_force_and_the_metric_are_told_is_explained_where_they_say() -> None:
    motion = PointMotion(skyarm.load_vehicle("hummingbird_arm2"), None)
    public = {name for name in dir(motion) if not name.startswith("_")}
    words = (inspect.getdoc(PointMotion) or "").replace("`", "")
    for name in public:
        own = getattr(PointMotion, name, None)
        explained = inspect.getdoc(own) if callable(own) or own is not None else ""
        assert explained or re.search(rf"\b{name}\b", words), name
    told = inspect.getdoc(MetricInstant) or ""
    for each in dataclasses.fields(MetricInstant):
        assert re.search(rf"\b{each.name}\b", told), each.name


def test_the_ball_shown_is_dragged_along_by_the_air() -> None:
    with registry_kept():
        ball = load_plugin(FOLDER / "own_force.py").Ball()
        planned = skyarm.load_scenario("case3", duration=0.05)
        vehicle, still = planned.plant.vehicle, skyarm.Session(planned).state
        motion = PointMotion(vehicle, still, lambda _: skyarm.Vec3(2.0, 0.0, 0.0))
        (wrench,) = ball.wrenches((), 0.0, motion, ())
        drag = 0.5 * 1.2 * 0.47 * 3.14159 * 0.05**2 * 2.0**2
        assert tuple(wrench.force_W) == pytest.approx((drag, 0.0, 0.0), abs=1e-6)
        assert (wrench.point, wrench.body) == motion.frame()
        assert (
            skyarm.run(dataclasses.replace(planned, forces=(ball,))).status
            == "completed"
        )


@pytest.fixture
def corridor_files(tmp_path: Path) -> Path:
    """A folder with the plugin of the example on endings, and its scenario as a file
    that needs it.
    """
    code = (FOLDER / "own_ending.py").read_text("utf-8")
    (tmp_path / "own_ending.py").write_text(code, "utf-8")
    table = code.partition('FLIGHT = """\n')[2].partition('"""')[0]
    needed = 'plugins = { need = ["own_ending.py"] }\n'
    (tmp_path / "narrow.toml").write_text(
        table.replace("duration", f"{needed}duration", 1), "utf-8"
    )
    return tmp_path


def test_the_ending_shown_ends_a_flight_and_its_words_are_the_logs(
    corridor_files: Path,
) -> None:
    with registry_kept():
        with pytest.raises(
            ValueError, match=r"skyarm\.load_plugin\('own_ending\.py'\)"
        ):
            skyarm.load_scenario(corridor_files / "narrow.toml")
        skyarm.load_plugin(corridor_files / "own_ending.py")
        log = skyarm.run(skyarm.load_scenario(corridor_files / "narrow.toml"))
    assert log.status == "left_corridor"
    assert abs(log.position[-1, 1]) == pytest.approx(0.2, abs=0.01)
    words = [
        "run",
        str(corridor_files / "narrow.toml"),
        "--plugin",
        str(corridor_files / "own_ending.py"),
        "-q",
    ]
    code, _ = run_command([*words, "--out", str(corridor_files / "out")])
    text = (FOLDER / "own_ending.py").read_text("utf-8")
    assert f"ends with exit code {code}" in text
    assert re.fullmatch(r"y = -?0\.2\d\d m is outside of 0\.2 m", log.info["cause"])


def test_the_package_shown_is_a_plugin(
    corridor_files: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = tomllib.loads(files("toml")["pyproject.toml"])
    ((name, module),) = table["project"]["entry-points"][plugins.GROUP].items()
    folder = f"src/{module.partition('.')[0]}"
    package = corridor_files / folder
    package.mkdir(parents=True)
    tree = re.findall(rf"^{folder}/(\S+)", PAGE, re.MULTILINE)
    assert tree == ["__init__.py", "corridor.py"]
    (package / tree[0]).write_text("", "utf-8")
    (package / tree[1]).write_text(
        (corridor_files / "own_ending.py").read_text("utf-8"), "utf-8"
    )
    monkeypatch.syspath_prepend(package.parent)
    entry = metadata.EntryPoint(name, module, plugins.GROUP)
    made = types.SimpleNamespace(
        name=table["project"]["name"], version=table["project"]["version"]
    )
    monkeypatch.setattr(plugins, "may_extend", lambda group: True)
    monkeypatch.setattr(metadata, "entry_points", lambda *, group: [entry._for(made)])  # type: ignore[attr-defined]
    with registry_kept():
        plugins.load_installed()
        assert plugins.identities()[made.name] == f"version {made.version}"
        needs = (
            (corridor_files / "narrow.toml")
            .read_text("utf-8")
            .replace('"own_ending.py"', f'"{made.name}"')
        )
        (corridor_files / "narrow.toml").write_text(needs, "utf-8")
        flight = skyarm.load_scenario(corridor_files / "narrow.toml", duration=0.1)
        assert type(flight.endings[0]).__module__ == module
        assert skyarm.run(flight).status == "completed"
    for each in (module, package.name):
        sys.modules.pop(each)


SECTION = PAGE[PAGE.index("## When your law is wrong") :].partition("\n## ")[0]
MISTAKES = re.findall(r"^\| .* \| (`.*) \|$", SECTION, re.MULTILINE)


def test_the_law_shown_flies() -> None:
    planned = skyarm.load_scenario("case3", duration=0.1)
    with registry_kept():
        make = skyarm.load_plugin(ROOT / "examples" / "own_law.py").make_lqr
    mine = make(planned.controller.par.model, weight=9.0)
    assert mine.par.base[0] == 3.0
    assert (
        skyarm.run(dataclasses.replace(planned, controller=mine)).status == "completed"
    )


@pytest.mark.parametrize(
    "words", [word for row in MISTAKES for word in re.findall("`([^`]+)`", row)]
)
def test_the_lines_that_a_wrong_law_gets_are_those_of_the_page(words: str) -> None:
    """Each stands in what the tests of wrong laws expect."""
    known = [
        mistake.words for group in (EVERYTHING, MAKERS) for mistake in group.values()
    ]
    assert any(words in each for each in known), words


SYMPTOMS = [
    word
    for row in re.findall(
        r"^\| (.*?) \|",
        (DOCS / "add_a_law.md").read_text("utf-8").partition("## If it fails")[2],
        re.MULTILINE,
    )
    for word in re.findall("`([^`]+)`", row)
]


def test_the_lines_that_the_page_on_laws_names_as_symptoms_stand_in_the_source() -> (
    None
):
    """At least three words of each in their order; names and numbers are those of the
    page.
    """
    source = "\n".join(
        path.read_text("utf-8")
        for path in sorted(Path(skyarm.__file__).parent.rglob("*.py"))
    )
    source = re.sub(r'"\s*\n\s*f?"', "", source)
    assert SYMPTOMS
    for words in (line.split() for line in SYMPTOMS if line.count(" ") > 1):
        runs = [" ".join(words[k : k + 3]) for k in range(len(words) - 2)]
        assert any(run.rstrip(":;,") in source for run in runs), " ".join(words)


def test_all_kinds_of_mistakes_are_on_the_page() -> None:
    assert len(MISTAKES) == 10


def test_the_sessions_shown_run(capsys: pytest.CaptureFixture[str]) -> None:
    *_, session, led, _batch, _law = blocks(
        (ROOT / "docs" / "python_api.md").read_text("utf-8"), "python"
    )
    names = {"skyarm": skyarm}
    for code in (session, led):
        exec(compile(code, "python_api.md", "exec"), names)
    out = capsys.readouterr().out
    assert "completed" in out
    assert out.splitlines()[-2:] == ["True", "completed 2"]


def test_the_law_shown_by_itself_is_compiled_and_a_thousand_times_faster(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Measured: 26 ms in Python, 1 us in machine code."""
    *_, shown = blocks((ROOT / "docs" / "python_api.md").read_text("utf-8"), "python")
    names = {"skyarm": skyarm}
    exec(compile(shown, "python_api.md", "exec"), names)
    assert capsys.readouterr().out == "4\n"
    law, inputs = names["law"], names["inputs"]

    def once(memory: Any, *given: Any) -> Any:
        return law.law(memory, *given, 0.005, par=law.par)

    quick = Quick(once, law.memory, *inputs)
    quick.inputs[:] = leaves((law.memory, *inputs))
    quick.step()
    assert quick.shaped() == (names["memory"], names["command"])

    def least(call: Any, times: int) -> float:
        return min(timeit.repeat(call, number=times, repeat=3)) / times

    python = least(lambda: law.law(law.memory, *inputs, 0.005, par=law.par), 1)
    assert least(quick.step, 300) < python / 1000


def test_examples_are_short() -> None:
    assert len(EXAMPLES) >= 10
    lines = {path.name: len(path.read_text("utf-8").splitlines()) for path in EXAMPLES}
    # training loops and the ways to run episodes are shown whole, and a recipe with
    # the flight of its part
    longer = {"ppo_residual.py", "learn_to_see.py", "many_episodes.py"} | {
        *(path.name for path in RECIPES)
    }
    assert {name for name, count in lines.items() if count > 40} == longer
    assert max(lines[path.name] for path in RECIPES) <= 170
    assert max(lines.values()) <= 300
