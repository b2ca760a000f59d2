"""The folder that ``skyarm compare`` flies into, and the lists of names that choose what flies."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from skyarm.cli.lines import say
from skyarm.cli.progress import bar
from skyarm.compare.cells import Flights
from skyarm.compare.comparison import prepare
from skyarm.compare.fly_comparison import Progress
from skyarm.compare.overwrites import require_same_plugins
from skyarm.files import must_be_one_of, require_writable, shown, taken_back
from skyarm.simulate.user_code import check_components, check_law


def flown_into(
    out: str, title: str, todo: Sequence[Flights], fly: Callable[[Progress], Any], console: Console, *, replaces: str
) -> Any:
    """Fly what is missing of a folder; one that was made here is gone where it is refused.

    Args:
        out: the folder.
        title: of the bar of progress.
        todo: cells of the folder that are asked for.
        fly: flies those that are missing, and tells its progress.
        console: of the bar.
        replaces: what the folder holds the report of, in words; "" for nothing else.

    Raises:
        ValueError, OSError: one line.
    """
    folder = Path(out)
    with taken_back(folder, folder / "cells"):
        prepare(require_writable(out))
        if replaces:
            say(f"{folder}: replaces the report of {replaces}", 0)
        require_same_plugins(todo, folder / "cells")
        with bar(title, console, pause=0.0) as advance:
            return fly(advance)


def try_every_law(todo: Sequence[Flights]) -> None:
    """Try code of one's own once for each law.

    Raises:
        ValueError: one line on what is wrong with it.
    """
    for flights in {each.entrant.name: each for each in todo}.values():
        scenario = flights.scenario()
        check_components(scenario)
        check_law(scenario)


def split_names(option: str, words: str, *, of: str = "") -> list[str]:
    """Names of a comma-separated list.

    Raises:
        ValueError: none at all.
    """
    names = [name.strip() for name in words.split(",") if name.strip()]
    if not names:
        raise ValueError(f"{option}: must name at least one{of}")
    return names


def chosen_names(option: str, words: str | None, there: Collection[str]) -> tuple[str, ...]:
    """Those of ``there`` that a list names, in the order of ``there``; all where there is no list.

    Raises:
        ValueError: a name that is not there.
    """
    if words is None:
        return tuple(there)
    names = split_names(option, words)
    for name in names:
        if name not in there:
            raise ValueError(f"{option} = {shown(name)}: {must_be_one_of(there, name)}")
    return tuple(name for name in there if name in names)
