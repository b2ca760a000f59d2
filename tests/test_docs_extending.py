"""The pages on extending and on sessions are true: their code runs, and every kind that can be registered is named."""

from __future__ import annotations

import dataclasses
import re
import timeit
from pathlib import Path
from typing import Any

import pytest

import skyarm
from added_components import registry_kept
from skyarm.registry import KINDS
from skyarm.registry.plugins import load_plugin
from wrong_laws import EVERYTHING, MAKERS

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs" / "extending.md").read_text("utf-8")
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


def blocks(text: str, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)


def test_every_kind_that_can_be_registered_is_on_the_page() -> None:
    assert re.findall(r"^\| `(\w+)` \|", PAGE, re.MULTILINE) == list(KINDS)


def test_the_air_shown_flies_by_its_name(tmp_path: Path) -> None:
    plugin, *_ = blocks(PAGE, "python")
    file = tmp_path / "wandering.py"
    file.write_text(plugin, "utf-8")
    with registry_kept():
        load_plugin(file)
        _fly_it(tmp_path)


def _fly_it(tmp_path: Path) -> None:
    case = (Path(skyarm.__file__).parent / "scenario" / "library" / "case3.toml").read_text("utf-8")
    (table,) = blocks(PAGE, "toml")
    flight = tmp_path / "mine.toml"
    flight.write_text(case + "\n" + table, "utf-8")
    log = skyarm.run(skyarm.load_scenario(flight, duration=1.0))
    assert log.status == "completed"
    assert log.air_velocity.std(axis=0).min() > 0.05


def test_the_largest_step_shown_is_a_drives() -> None:
    (property_,) = [block for block in blocks(PAGE, "python") if "largest_step" in block]
    names = {"skyarm": skyarm}
    exec(f"class Stiff(skyarm.Drive):\n    stiffness, damping, inertia = 8.0, 0.1, 8e-5\n{property_}", names)
    # 0.1 / 8e-5 = 1250 /s is faster than the square root of 8 / 8e-5, 316 rad/s
    assert names["Stiff"]().largest_step == pytest.approx(1.0 / 1250.0)


SECTION = PAGE[PAGE.index("## When your law is wrong") :].partition("\n## ")[0]
MISTAKES = re.findall(r"^\| .* \| (`.*) \|$", SECTION, re.MULTILINE)


def test_the_constants_shown_are_what_a_law_needs() -> None:
    from skyarm.actuation import mix

    def law(memory: Any, _seen: Any, _wanted: Any, _dt: Any, *, par: Any) -> tuple[Any, skyarm.Command]:
        push = par.model.vehicle.mass * par.model.gravity
        speeds, _ = mix(par.mixer, skyarm.Vec3(0.0, 0.0, 0.0), push)
        return memory, skyarm.Command(rotor_speeds=speeds, efforts=(0.0, 0.0))

    (shown,) = [block for block in blocks(PAGE, "python") if "class Constants" in block]
    names: dict[str, Any] = {"law": law}
    exec(shown, names)
    planned = skyarm.load_scenario("case3", duration=0.1)
    mine = names["make"](planned.controller.par.model)
    assert skyarm.run(dataclasses.replace(planned, controller=mine)).status == "completed"


@pytest.mark.parametrize("words", [word for row in MISTAKES for word in re.findall("`([^`]+)`", row)])
def test_the_lines_that_a_wrong_law_gets_are_those_of_the_page(words: str) -> None:
    """Each stands in what the tests of wrong laws expect."""
    known = [mistake.words for group in (EVERYTHING, MAKERS) for mistake in group.values()]
    assert any(words in each for each in known), words


def test_all_kinds_of_mistakes_are_on_the_page() -> None:
    assert len(MISTAKES) == 10


def test_the_sessions_shown_run(capsys: pytest.CaptureFixture[str]) -> None:
    *_, session, led, batch = blocks((ROOT / "docs" / "python_api.md").read_text("utf-8"), "python")
    names = {"skyarm": skyarm}
    for code in (session, led, batch):
        exec(compile(code, "python_api.md", "exec"), names)
    out = capsys.readouterr().out
    assert "completed" in out
    assert "True completed 2" in out
    assert "(1024,) False" in out


def test_the_law_shown_by_itself_is_compiled_and_a_thousand_times_faster(capsys: pytest.CaptureFixture[str]) -> None:
    """Measured: 26 ms in Python, 1 us in machine code."""
    *_, shown, _session, _led, _batch = blocks((ROOT / "docs" / "python_api.md").read_text("utf-8"), "python")
    names = {"skyarm": skyarm}
    exec(compile(shown, "python_api.md", "exec"), names)
    assert capsys.readouterr().out == "True\n"
    law, told, quick = names["law"], names["told"], names["quick"]

    def least(call: Any, times: int) -> float:
        return min(timeit.repeat(call, number=times, repeat=3)) / times

    python = least(lambda: law.law(law.memory, *told, 0.005, par=law.par), 1)
    assert least(quick.step, 300) < python / 1000


def test_examples_are_short() -> None:
    assert len(EXAMPLES) >= 10
    lines = {path.name: len(path.read_text("utf-8").splitlines()) for path in EXAMPLES}
    # a training loop is shown whole, in one file
    assert {name for name, count in lines.items() if count > 40} == {"ppo_residual.py"}
    assert max(lines.values()) <= 300
