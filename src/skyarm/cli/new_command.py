"""Command ``skyarm new``: commented starter files, which fly without changes."""

from __future__ import annotations

import keyword
import re
import shlex
import sys
from importlib import resources
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from skyarm.cli.arguments import Force, Out, word_completion
from skyarm.cli.output import give, tell
from skyarm.records.files import must_be_one_of, require_writable, shown, write_atomically
from skyarm.records.files.earlier_files import naming
from skyarm.records.files.names import is_result_name
from skyarm.records.files.writing import require_new

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,59}")

KINDS: dict[str, tuple[tuple[str, str], ...]] = {
    "vehicle": (
        ("vehicle.toml.txt", "NAME.toml"),
        ("hover.toml.txt", "NAME_hover.toml"),
        ("vehicle_test.py.txt", "test_NAME.py"),
    ),
    "scenario": (("scenario.toml.txt", "NAME.toml"), ("scenario_test.py.txt", "test_NAME.py")),
    "law": (("law.py.txt", "NAME.py"), ("law_test.py.txt", "test_NAME.py")),
    "study": (("study.toml.txt", "NAME.toml"), ("study_test.py.txt", "test_NAME.py")),
}
"""Kind -> (shipped file, written file)."""

FIRST = {
    "vehicle": "skyarm run {file}_hover.toml",
    "scenario": "skyarm run {file}.toml",
    "law": "skyarm run case3 --laws {file}.py:make",
    "study": "skyarm sweep {file}.toml --out out/{name}",
}
"""Kind -> command that flies the new files."""


def new(
    kind: Annotated[
        str,
        typer.Argument(
            metavar="KIND",
            help="vehicle, scenario, law or study",
            autocompletion=word_completion(*KINDS),
        ),
    ],
    name: Annotated[str, typer.Argument(metavar="NAME", help="name of the files and of what they describe")],
    out: Out = ".",
    force: Force = False,
) -> None:
    """Write starter files of a vehicle, scenario, law or study.

    Commented files, which fly as they are, with a test for pytest.
    """
    files = write_starter(kind, name, out, force=force)
    first = shlex.join(word.format(file=Path(out, name), name=name) for word in FIRST[kind].split())
    give(kind=kind, name=name, files=files, next=first)
    tell(f"written: {', '.join(map(str, files))}", f"fly it: {first}")


def write_starter(kind: str, name: str, folder: str | Path, *, force: bool = False) -> list[Path]:
    """Write the starter files of a new vehicle, scenario, law or study into a folder, all or none.

    Files of these names are replaced only by ``force``.

    Raises:
        ValueError: one line: no such kind, no name for files of this kind, or a file that is there already.
        OSError: the folder cannot be written.
    """
    if kind not in KINDS:
        raise ValueError(f"kind = {shown(kind)}: {must_be_one_of(tuple(KINDS), kind)}")
    allowed = "must be a letter, then up to 59 letters, digits and _, no word of Python's and no device of Windows"
    if not NAME.fullmatch(name) or keyword.iskeyword(name) or not is_result_name(name):
        raise ValueError(f"name = {shown(name)}: {allowed}")
    if kind == "law" and (name in sys.stdlib_module_names or name == "conftest" or find_spec(name) is not None):
        raise ValueError(f"name = {shown(name)}: must not be that of a module: {name}.py would hide it")
    files = [Path(folder, written.replace("NAME", name)) for _, written in KINDS[kind]]
    require_writable(folder)
    done: list[Path] = []
    with naming(Path(folder)):  # or two at once would both find the names free
        for file in () if force else files:
            require_new(file)
        try:
            for (ships, _), file in zip(KINDS[kind], files, strict=True):
                text = (resources.files("skyarm.cli") / "starters" / ships).read_text("utf-8")
                done.append(write_atomically(file, text.replace("NAME", name).encode()))
        except BaseException:
            for file in done:
                file.unlink(missing_ok=True)
            raise
    return files
