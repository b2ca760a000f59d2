"""``--json`` and ``--quiet``: every command has them, and gives the keys that the
documentation names.
"""

from __future__ import annotations

import importlib.util
import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pytest
import typer
from command_files import FALLS, SHORT
from every_command import CHOOSES, COMMANDS, KEPT, NEEDS, READS, SERVES

import skyarm as package
from skyarm.cli import output
from skyarm.cli.commands import COMMANDS as SHIPPED
from skyarm.cli.output import STYLES, Terminal
from skyarm.paper.published import PAPER
from skyarm.studies.assess.finding import LEVELS
from support.cases import sampled
from support.commands import refused, skyarm
from support.components import registry_kept

DOCS = Path(__file__).resolve().parents[2] / "docs" / "command_line.md"
HEAD = {"schema", "command", "skyarm"}
STUDY = """
schema = 1
name = "tiny"
scenario = "case3_wind"
controllers = ["paper_ct"]
duration = 0.2
episodes = 8
[windows]
steady = [0.1, 0.2]
[vary]
"plant.vehicle.base.mass" = { uniform = [0.7, 0.9] }
"""


THERE = set(SHIPPED)


def documented() -> dict[str, set[str]]:
    """Command -> keys that the page's table of it names; one with a question mark is
    not always there.
    """
    blocks = re.findall(
        r"<!-- generated: keys ([\w-]+) -->\n(.*?)<!-- /generated -->",
        DOCS.read_text("utf-8"),
        re.S,
    )
    return {
        command: {
            f"{name}?" if present == "sometimes" else name
            for name, present in ROW.findall(block)
        }
        for command, block in blocks
    }


ROW = re.compile(r"^\| `(\w+)` \| (always|sometimes) \| [^|]+ \|$", re.MULTILINE)


def reproduced(out: str, **_options: Any) -> dict[str, Any]:
    """In place of a reproduction of a minute: every cell the paper's."""
    plants = {"rigid_body": 1.0, "mujoco": 1.0}
    beside = {"held_position_error": None}
    experiments = {
        case: {
            law: {
                name: {"paper": value, **plants}
                for name, value in (cells | beside).items()
            }
            for law, cells in laws.items()
        }
        for case, laws in PAPER.items()
    }
    return {"schema": 1, "experiments": experiments, "settings": {}}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("commands")
    (path / "short.toml").write_text(SHORT)
    (path / "study.toml").write_text(STUDY)
    package.save_log(
        package.run(package.load_scenario("case3", duration=8.0)), path / "flight.npz"
    )
    return path


@pytest.fixture(autouse=True)
def _in_folder(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    monkeypatch.setattr("skyarm.paper.reproduce.reproduce", reproduced)
    # tried in test_doctor.py
    monkeypatch.setattr("skyarm.cli.doctor_command.TRIALS", {})


def test_every_command_is_tried_here_and_documented() -> None:
    assert set(COMMANDS) | set(SERVES) == THERE, (
        "enter it in tests/cli/every_command.py"
    )
    assert set(documented()) | set(SERVES) == THERE, (
        "enter its keys in docs/command_line.md"
    )


@pytest.mark.parametrize("command", sorted(THERE))
def test_every_command_takes_the_common_options_and_says_so(command: str) -> None:
    text = skyarm(command, "--help").out
    assert re.search(r"^  --json  +the result as one JSON document", text, re.MULTILINE)
    assert re.search(r"^  -q, --quiet  +no output and no progress", text, re.MULTILINE)
    assert re.search(
        r"^  --plugin FILE.py  +a .py file that registers names; repeat",
        text,
        re.MULTILINE,
    )
    assert ("-o, --out " in text) == (command not in READS), (
        "enter it in tests/cli/every_command.py"
    )
    assert ("--laws LAW" in text) == (command in CHOOSES)


def test_a_short_option_of_a_plugin_s_command_stays_its_own() -> None:
    def own(quantity: Annotated[int, typer.Option("-q")] = 3) -> None:
        """Say a number."""
        print(f"quantity {quantity}")

    assert run_own(own, "-q", "5").out == "quantity 5\n"
    assert run_own(own, "-q", "5", "--quiet").out == ""


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_gives_one_document_with_the_keys_that_are_documented(
    command: str,
) -> None:
    if command in NEEDS and importlib.util.find_spec(NEEDS[command]) is None:
        pytest.skip(f"{NEEDS[command]} is not installed")
    ended = skyarm(command, *COMMANDS[command], "--json")
    assert ended.code == 0, ended.err
    found = json.loads(ended.out, parse_constant=pytest.fail)
    assert list(found)[:3] == ["schema", "command", "skyarm"]
    assert (found["schema"], found["command"]) == (output.SCHEMA, command)
    assert found["skyarm"] == package.__version__
    named = documented()[command]
    always = {key for key in named if not key.endswith("?")}
    sometimes = {key.rstrip("?") for key in named if key.endswith("?")}
    assert always <= set(found) - HEAD <= always | sometimes
    assert ended.out.isascii()


@pytest.mark.parametrize("command", sampled(list(COMMANDS), 4))
def test_a_quiet_command_says_nothing(command: str) -> None:
    if command in NEEDS and importlib.util.find_spec(NEEDS[command]) is None:
        pytest.skip(f"{NEEDS[command]} is not installed")
    for file in KEPT.get(command, ()):
        Path(file).unlink(missing_ok=True)
    ended = skyarm(command, *COMMANDS[command], "-q")
    assert (ended.code, ended.out, ended.err) == (0, "", "")


def test_wrong_input_is_a_line_and_no_document() -> None:
    for option in ("--json", "--quiet"):
        ended = skyarm("run", "nowhere", option)
        refused(ended, "nowhere")
        assert ended.out == ""


def test_a_flight_that_ended_early_is_a_document_and_keeps_its_exit_code(
    folder: Path,
) -> None:
    (folder / "falls.toml").write_text(FALLS)
    ended = skyarm("run", "falls.toml", "--json")
    assert ended.code == 3, ended
    found = json.loads(ended.out)
    assert found["status"] != "completed"
    assert found["cause"]
    assert found["end_time"] < 5.0


def test_the_numbers_of_a_document_are_those_of_the_flight() -> None:
    found = json.loads(skyarm("run", "case3", "--duration", "1", "--json").out)
    log = package.load_log(found["logs"][0])
    error = np.linalg.norm(log.tool - log.tool_reference, axis=1)
    inside = (log.time >= found["steady_window_s"][0]) & (
        log.time < found["steady_window_s"][1]
    )
    wanted = {
        "mean": error[inside].mean(),
        "max": error[inside].max(),
        "max_whole_flight": error.max(),
    }
    assert found["errors_continuous"]["tip"] == pytest.approx(wanted, rel=1e-12)


def test_an_error_of_one_name_has_one_value_in_every_command() -> None:
    """run, score and diff: against the continuous reference where the name says so,
    else the held one.
    """
    found = json.loads(skyarm("run", "case3", "--duration", "12", "--json").out)
    (file, *_), again = found["logs"], package.load_log(found["logs"][0])
    scored = package.score(again, ["standard", "standard_continuous"])
    for what, name in (("position", "position"), ("joints", "joint"), ("tip", "ee")):
        for how in ("mean", "max"):
            value = found["errors_continuous"][what][how]
            assert value == pytest.approx(
                scored[f"{name}_error_{how}_continuous"], rel=1e-9
            )
            # the largest may be at rest, where the held reference is the continuous one
            assert how == "max" or value != pytest.approx(
                scored[f"{name}_error_{how}"], rel=1e-9
            )
    told = skyarm("diff", file, file).out
    assert re.findall(r"^(position_error_mean\w*)", told, re.M) == [
        "position_error_mean_continuous"
    ]
    assert f"{scored['position_error_mean_continuous']:.4g}" in told
    for metrics in json.loads(skyarm("diff", file, file, "--json").out)["metrics"]:
        assert {name: metrics[name] for name in scored} == pytest.approx(scored)


@pytest.mark.skipif(sys.platform == "win32", reason="the shell's pipe and quotes")
def test_the_pipe_that_the_documentation_shows_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pipe = (
        r"^```bash\n(skyarm run case3 --json \|.*)\n```\n<!-- [^>]*"
        r" -->\n```text\n((?:.*\n)*?)```$"
    )
    ((line, printed),) = re.findall(pipe, DOCS.read_text("utf-8"), re.MULTILINE)
    words = line.replace(
        "skyarm run case3", f"{sys.executable} -m skyarm run case3 --duration 1"
    )
    words = words.replace("| python ", f"| {sys.executable} ")
    done = subprocess.run(
        words, shell=True, capture_output=True, text=True, cwd=tmp_path, check=True
    )
    assert done.stdout == printed == "completed\n"
    assert not done.stderr


def test_what_json_lacks_becomes_null_list_and_text() -> None:
    given = {
        "a": np.array([1.0, np.inf]),
        "b": (1, float("nan")),
        "c": Path("x"),
        "d": np.int64(3),
        5: {"e": True},
    }
    assert output.plain(given) == {
        "a": [1.0, None],
        "b": [1, None],
        "c": "x",
        "d": 3,
        "5": {"e": True},
    }


def run_own(function: Any, *words: str) -> Any:
    """A command that a plugin might bring, through the whole program."""
    with registry_kept():
        package.register.command("own-words")(function)
        return skyarm("own-words", *words)


def test_a_command_of_one_s_own_has_the_options_and_its_lines_are_the_document() -> (
    None
):
    def own(number: int = 3) -> None:
        """Say a number."""
        print(f"number {number}")

    ended = run_own(own, "--number", "4", "--json")
    assert json.loads(ended.out)["lines"] == ["number 4"]
    assert run_own(own, "--quiet").out == ""
    assert run_own(own).out == "number 3\n"


def test_no_colour_goes_where_nobody_wants_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """A terminal in colours; none with NO_COLOR, and none where it is dumb or no
    terminal.
    """
    import io

    class Screen(io.StringIO):
        def isatty(self) -> bool:
            return True

    def shown(file: io.StringIO) -> str:
        Terminal(file=file, color_system="auto").print("x", style="red")
        return file.getvalue()

    for name in ("NO_COLOR", "FORCE_COLOR", "TTY_COMPATIBLE"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("TERM", "xterm-256color")
    assert "\x1b[31m" in shown(Screen())
    assert shown(io.StringIO()) == "x\n"
    monkeypatch.setenv("NO_COLOR", "1")
    assert "\x1b[31m" not in shown(Screen())
    assert sys.stdout is not None


def test_every_level_of_a_finding_has_a_colour() -> None:
    assert tuple(STYLES) == LEVELS
