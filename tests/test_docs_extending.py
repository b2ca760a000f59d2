"""The pages on extending and on sessions are true: their code runs, and every kind that
can be registered is named.

Every page docs/add_a_*.md runs whole in tests/website; here are the checks of what its
parts do.
"""

from __future__ import annotations

import dataclasses
import inspect
import re
import sys
import timeit
import tomllib
import types
from importlib import import_module, metadata
from pathlib import Path
from typing import Any

import pytest

import skyarm
from shown_commands import run_command
from skyarm.algebra import scalars
from skyarm.dynamics.point_motion import PointMotion
from skyarm.records.registry import KINDS, plugins
from skyarm.records.registry.contract import CONTRACTS
from skyarm.records.registry.plugins import load_plugin
from support.components import EVERYTHING, MAKERS, registry_kept

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
PAGE = (DOCS / "extending.md").read_text("utf-8")
PAGES = {path.stem: path.read_text("utf-8") for path in sorted(DOCS.glob("add_a*.md"))}
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


def blocks(text: str, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)


def test_every_kind_that_can_be_registered_is_on_the_page() -> None:
    table = PAGE.partition("\n## ")[0]
    assert re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE) == list(KINDS)


def test_each_kind_that_can_be_registered_leads_to_a_page_or_says_how() -> None:
    linked = set(re.findall(r"\]\((add_a\w+)\.md", PAGE.partition("\n## ")[0]))
    assert linked == set(PAGES)


@pytest.mark.parametrize(
    "plugin",
    [DOCS / "add_a_wind.md", ROOT / "examples" / "own_wind.py"],
    ids=["page", "example"],
)
def test_the_air_shown_flies_by_its_name(plugin: Path, tmp_path: Path) -> None:
    text, kind = plugin.read_text("utf-8"), "gusty"
    if plugin.suffix == ".md":
        text, kind = files("python", "add_a_wind")["breeze.py"], "breeze"
    (tmp_path / "wind.py").write_text(text, "utf-8")
    flight = tomllib.loads(files("toml", "add_a_wind")["breezy.toml"])
    flight["environment"]["air"][0]["kind"] = kind
    with registry_kept():
        load_plugin(tmp_path / "wind.py")
        log = skyarm.run(
            skyarm.scenario_from(
                flight | {"duration": 1.0, "plugins": {"need": ["wind.py"]}}
            )
        )
    assert log.status == "completed"
    assert log.air_velocity[:, :2].std(axis=0).min() > 0.05


def test_the_fault_and_the_signal_shown_are_read_and_fly(tmp_path: Path) -> None:
    file = tmp_path / "fading.py"
    file.write_text(files("python", "add_a_world_part")["fading.py"], "utf-8")
    stated = tomllib.loads(files("toml", "add_a_world_part")["tired.toml"]) | {
        "duration": 0.1
    }
    with registry_kept():
        load_plugin(file)
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


def files(language: str, page: str = "") -> dict[str, str]:
    """Files of a page, that on all parts if left out, by their titles."""
    text = PAGES[page] if page else PAGE
    return dict(
        re.findall(rf'```{language} title="([^"]+)"\n(.*?)```', text, re.DOTALL)
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


def test_the_table_of_points_is_the_class_and_its_arguments() -> None:
    motion = PointMotion(skyarm.load_vehicle("hummingbird_arm2"), None)
    known = {name for name in dir(motion) if not name.startswith("_")}
    shown = [
        word
        for row in rows_of("What `motion` knows", PAGES["add_a_force"])
        for word in re.findall(r"`([^`]+)`", row)
    ]
    assert {word.partition("(")[0] for word in shown} == known
    for name, _, arguments in (word.rstrip(")").partition("(") for word in shown):
        if arguments:
            taken = inspect.signature(getattr(PointMotion, name)).parameters
            assert [*taken][1:] == arguments.split(", "), name


def test_the_ball_shown_is_dragged_along_by_the_air(tmp_path: Path) -> None:
    file = tmp_path / "ball.py"
    file.write_text(files("python", "add_a_force")["ball.py"], "utf-8")
    with registry_kept():
        ball = skyarm.load_plugin(file).Ball()
        planned = skyarm.load_scenario("case3", duration=0.05)
        vehicle, still = planned.plant.vehicle, skyarm.Session(planned).state
        motion = PointMotion(vehicle, still, lambda _: skyarm.Vec3(2.0, 0.0, 0.0))
        (wrench,) = ball.wrenches((), 0.0, motion, ())
        drag = 0.5 * 1.2 * 0.47 * 3.14159 * 0.05**2 * 2.0**2
        assert tuple(wrench.force_W) == pytest.approx((drag, 0.0, 0.0))
        assert (wrench.point, wrench.body) == motion.frame()
        assert (
            skyarm.run(dataclasses.replace(planned, forces=(ball,))).status
            == "completed"
        )


@pytest.fixture
def corridor_files(tmp_path: Path) -> Path:
    """A folder with the plugin and the scenario of the page on endings."""
    (tmp_path / "corridor.py").write_text(
        files("python", "add_an_ending")["corridor.py"], "utf-8"
    )
    (tmp_path / "narrow.toml").write_text(
        files("toml", "add_an_ending")["narrow.toml"], "utf-8"
    )
    return tmp_path


def test_the_ending_shown_ends_a_flight_and_its_words_are_the_logs(
    corridor_files: Path,
) -> None:
    with registry_kept():
        with pytest.raises(ValueError, match=r"skyarm\.load_plugin\('corridor\.py'\)"):
            skyarm.load_scenario(corridor_files / "narrow.toml")
        skyarm.load_plugin(corridor_files / "corridor.py")
        log = skyarm.run(skyarm.load_scenario(corridor_files / "narrow.toml"))
    assert log.status == "left_corridor"
    assert abs(log.position[-1, 1]) == pytest.approx(0.2, abs=0.01)
    words = [
        "run",
        str(corridor_files / "narrow.toml"),
        "--plugin",
        str(corridor_files / "corridor.py"),
        "-q",
    ]
    code, _ = run_command([*words, "--out", str(corridor_files / "out")])
    assert f"ends with exit code {code}" in " ".join(PAGES["add_an_ending"].split())
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
        files("python", "add_an_ending")["corridor.py"], "utf-8"
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
            .replace('"corridor.py"', f'"{made.name}"')
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


SYMPTOMS = {
    page: [
        word
        for row in re.findall(
            r"^\| (.*?) \|",
            text.partition("## If it fails")[2].partition("\n## ")[0],
            re.MULTILINE,
        )
        for word in re.findall("`([^`]+)`", row)
    ]
    for page, text in PAGES.items()
}


def test_the_lines_that_a_page_names_as_symptoms_stand_in_the_source() -> None:
    """At least three words of each in their order; names and numbers are those of the
    page.
    """
    source = "\n".join(
        path.read_text("utf-8")
        for path in sorted(Path(skyarm.__file__).parent.rglob("*.py"))
    )
    source = re.sub(r'"\s*\n\s*f?"', "", source)
    for page, lines in SYMPTOMS.items():
        assert lines, page
        for words in (
            line.split()
            for line in lines
            if line.count(" ") > 1 and not line.startswith("first in")
        ):
            runs = [" ".join(words[k : k + 3]) for k in range(len(words) - 2)]
            assert any(run.rstrip(":;,") in source for run in runs), (
                f"{page}: {' '.join(words)}"
            )


def test_all_kinds_of_mistakes_are_on_the_page() -> None:
    assert len(MISTAKES) == 10


def test_the_sessions_shown_run(capsys: pytest.CaptureFixture[str]) -> None:
    *_, session, led, _quick = blocks(
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
    assert capsys.readouterr().out == "True\n"
    law, inputs, quick = names["law"], names["inputs"], names["quick"]

    def least(call: Any, times: int) -> float:
        return min(timeit.repeat(call, number=times, repeat=3)) / times

    python = least(lambda: law.law(law.memory, *inputs, 0.005, par=law.par), 1)
    assert least(quick.step, 300) < python / 1000


def test_examples_are_short() -> None:
    assert len(EXAMPLES) >= 10
    lines = {path.name: len(path.read_text("utf-8").splitlines()) for path in EXAMPLES}
    # a training loop is shown whole, in one file
    assert {name for name, count in lines.items() if count > 40} == {"ppo_residual.py"}
    assert max(lines.values()) <= 300
