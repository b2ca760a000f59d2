"""Command ``skyarm new``: commented starter files, which fly without changes."""

from __future__ import annotations

import keyword
import re
import shlex
import sys
from collections.abc import Mapping
from importlib import resources
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from skyarm.cli.arguments import Force, Out, require_left_out, word_completion
from skyarm.cli.output import give, tell
from skyarm.records.files import (
    must_be_one_of,
    require_writable,
    shipped_tables,
    shown,
    write_atomically,
)
from skyarm.records.files.earlier_files import naming
from skyarm.records.files.names import is_result_name
from skyarm.records.files.writing import require_new
from skyarm.studies.assess.assessment import check as assess
from skyarm.vehicle.imported_shapes import IMPORTS
from skyarm.vehicle.own_file import bare_multirotor, own_vehicle_file

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,59}")

_TABLES = shipped_tables(__file__)

KINDS: Mapping[str, Mapping[str, str]] = _TABLES["kinds"]
"""Kind -> shipped file -> written file."""


def new(
    kind: Annotated[str, word_completion(*KINDS)],
    name: str,
    source: Annotated[str, typer.Option("--from")] = "",
    tip: str = "",
    collisions: Annotated[str, word_completion(*IMPORTS)] = "none",
    rotors: int = 0,
    arm_length: float = 0.25,
    mass: float = 1.5,
    out: Out = ".",
    force: Force = False,
) -> None:
    """Write starter files of a vehicle, scenario, law or study.

    Commented files, which fly as they are, with a test for pytest. Of a vehicle --from
    FILE numbers that FILE lacks are comments to fill in, and the scenario and the test
    are written if there is none.

    Options:
        kind KIND: vehicle, scenario, law or study
        name NAME: name of the files and of what they describe
        source FILE: vehicle: write the whole vehicle of a .urdf, .xml or other file as
            TOML
        tip NAME: with --from: link or frame that is the end effector
        collisions WORD: with --from: shapes that touch: none, file or capsules
        rotors N: vehicle: write a bare multirotor of 4, 6, 8, 10 or 12
        arm_length: with --rotors: from the middle to a hub, m
        mass: with --rotors: kg
    """
    if source and kind != "vehicle":
        raise ValueError(
            f"--from = {shown(source)}: must be left out unless KIND is vehicle"
        )
    if tip and not source:
        raise ValueError(f"--tip = {shown(tip)}: must stand beside --from")
    if not source:
        require_left_out(["--collisions"], " without --from")
    if not rotors:
        require_left_out(["--arm-length", "--mass"], " without --rotors")
    elif source or kind != "vehicle":
        raise ValueError(f"--rotors = {rotors}: must be of a vehicle without --from")
    own, flies = "", True
    if source:
        own, flies = own_vehicle_file(source, name, tip, collisions)
    if rotors:
        own = bare_multirotor(name, rotors, arm_length, mass)
    files = write_starter(kind, name, out, force=force, own=own, flies=flies)
    # the check of a few poses suffices for the next command
    fails = bool(own and flies) and not assess(files[0], poses=64).flies
    first = _TABLES["first"][kind if flies and not fails else "unfinished"]
    first = shlex.join(
        word.format(file=Path(out, name), name=name) for word in first.split()
    )
    give(kind=kind, name=name, files=files, next=first)
    what = (
        "fly it"
        if flies
        else "without rotors that are whole it does not fly; what it lacks"
    )
    what = "the check of the vehicle finds a fault; which one" if fails else what
    tell(f"written: {', '.join(map(str, files))}", f"{what}: {first}")


def write_starter(
    kind: str,
    name: str,
    folder: str | Path,
    *,
    force: bool = False,
    own: str = "",
    flies: bool = True,
) -> list[Path]:
    """Write the starter files of a new vehicle, scenario, law or study into a folder,
    all or none.

    Files of these names are replaced only by ``force``. ``own`` is the text of a
    vehicle in place of the starter's; its scenario and test are written if it flies.

    Raises:
        ValueError: one line: no such kind, no name for files of this kind, or a file
            that is there already.
        OSError: the folder cannot be written.
    """
    if kind not in KINDS:
        raise ValueError(f"kind = {shown(kind)}: {must_be_one_of(tuple(KINDS), kind)}")
    allowed = (
        "must be a letter, then up to 59 letters, digits and _, no word of Python's and"
        " no device of Windows"
    )
    if not NAME.fullmatch(name) or keyword.iskeyword(name) or not is_result_name(name):
        raise ValueError(f"name = {shown(name)}: {allowed}")
    # a law's file is imported by its name, so it would hide a module of that name
    if kind == "law" and (
        name in sys.stdlib_module_names
        or name == "conftest"
        or find_spec(name) is not None
    ):
        raise ValueError(
            f"name = {shown(name)}: must not be that of a module: {name}.py would"
            " hide it"
        )
    starters = resources.files("skyarm.cli") / "starters"
    texts = {Path(folder, f"{name}.toml"): own} if own else {}
    shipped = KINDS[kind]
    if own:
        # a vehicle with gaps does not fly, so neither scenario nor test would run
        shipped = _TABLES["own"] if flies else {}
    for ships, written in shipped.items():
        text = (starters / ships).read_text("utf-8")
        texts[Path(folder, written.replace("NAME", name))] = text.replace("NAME", name)
    require_writable(folder)
    done: list[Path] = []
    with naming(Path(folder)):  # or two at once would both find the names free
        for file in () if force else texts:
            require_new(file)
        try:
            for file, text in texts.items():
                done.append(write_atomically(file, text.encode()))
        # all files or none, also after an interrupt
        except BaseException:
            for file in done:
                file.unlink(missing_ok=True)
            raise
    return done
