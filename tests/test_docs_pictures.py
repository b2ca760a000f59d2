"""What the page on pictures shows is true: its commands draw, its code draws, its study
derives an arm's length.
"""

from __future__ import annotations

import contextlib
import re
import shlex
from pathlib import Path

import pytest

from support.commands import skyarm
from support.components import registry_kept
from support.worlds import touching

DOCS = Path(__file__).resolve().parents[1] / "docs"
PAGE = (DOCS / "pictures.md").read_text("utf-8").partition("\n## Films\n")[0]
COMMANDS = re.findall(
    r"^(skyarm .*)$",
    "".join(re.findall(r"^```sh\n(.*?)^```$", PAGE, re.M | re.S)),
    re.M,
)
STUDY = (DOCS.parent / "examples" / "arm_length.toml").read_text("utf-8")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """With the page's study, shortened, and a flight that presses."""
    pytest.importorskip("pyarrow")
    made: Path = tmp_path_factory.mktemp("pictures")
    short = re.sub(r"episodes = \d+", "episodes = 40", STUDY).replace(
        "duration = 12", "duration = 0.3"
    )
    short = re.sub(
        r"controllers = .*", 'controllers = ["paper_ct", "paper_pd"]', short
    )  # a law of its own takes seconds
    text = re.sub(
        r"windows = .*",
        "windows = { steady = [0.1, 0.3], transient = [0.0, 0.1] }",
        short,
    )
    (made / "examples").mkdir()
    (made / "examples" / "arm_length.toml").write_text(text)
    touching().save_npz(made / "press.npz")
    return made


@pytest.mark.site
def test_the_commands_shown_draw_in_their_order(folder: Path) -> None:
    made = []
    with contextlib.chdir(folder), registry_kept():
        for command in COMMANDS:
            words = shlex.split(command)[1:]
            words += ["--duration", "6.5"] if words[0] == "run" else []
            done = skyarm(*words)
            assert done.code == 0, (words, done.err)
            made += [
                words[words.index(option) + 1]
                for option in ("-o", "--drawing")
                if option in words
            ]
    assert len(made) == len(set(made)) == 4
    for name in made:
        assert (folder / name).stat().st_size > 5_000, name


def test_the_code_shown_draws(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    blocks = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    assert len(blocks) == 2
    with contextlib.chdir(folder):
        exec(compile("\n".join(blocks), "pictures.md", "exec"), {})
    assert capsys.readouterr().out.splitlines() == ["Tip error [mm]"]
    assert {"flight.pdf", "bent.pdf"} <= {path.name for path in folder.iterdir()}


def test_every_kind_stands_on_the_page() -> None:
    from skyarm.records.files.names import SUFFIXES
    from skyarm.view.figures.flight_panels import ALL, DEPTH, KINDS, PATH

    found = re.findall(r"^\| `(\w+)` \|", PAGE, re.MULTILINE)
    assert found == [*KINDS, ALL, PATH, DEPTH]
    assert all(suffix.upper() in PAGE for suffix in SUFFIXES)


def test_the_study_of_the_page_on_study_files_loads() -> None:
    import tomllib

    from skyarm.studies.sweep import study_from

    text = (DOCS / "study_files.md").read_text("utf-8")
    tables = [
        block
        for block in re.findall(r"```toml\n(.*?)```", text, re.DOTALL)
        if "[derived]" in block
    ]
    for table in tables:
        study = study_from(tomllib.loads(table))
        assert "moment" in study.derived
        assert study.success
    assert len(tables) == 1
