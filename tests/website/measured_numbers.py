"""Run the commands behind the measured tables of the pages, and write what they print
into the pages.

    python tests/website/measured_numbers.py                 every command that was not
                                                             run for this tree yet:
                                                             hours
    python tests/website/measured_numbers.py --only delays   these only, by their names
    python tests/website/measured_numbers.py --list          state, minutes and command
                                                             of every table; runs
                                                             nothing

A page holds ``<!-- measured: NAME -->``, tables, a line "skyarm VERSION, PROCESSOR,
`COMMAND`." and ``<!-- /measured -->``. ``numbers.toml`` has the command of every name.
A command that ended is kept in out/numbers with the digest of the tree that it
measured; Ctrl-C and ``kill -9`` lose the one that runs.
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import textwrap
import time
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
DOCS, TESTS = ROOT / "docs", ROOT / "tests"
TABLES = Path(__file__).with_name("numbers.toml")
KEPT = ROOT / "out" / "numbers"
WIDTH = 100
"""Letters of a line of a page."""

BLOCK = re.compile(
    r"^<!-- measured: ([\w-]+) -->\n(.*?)^<!-- /measured -->$", re.M | re.S
)
LAST = re.compile(
    r"^skyarm (?P<version>\S+), (?P<machine>[^`]+), (?:`(?P<command>[^`]+)`|no"
    r" command)\.\n\Z",
    re.M,
)
SCRIPT = re.compile(r"\b(?:tests|examples|research)/[\w/.-]+\.py\b")
RULE = re.compile(r"\|[\s:|-]+\|$")
ROOMS = (TESTS, TESTS / "website", TESTS / "studies" / "bench", TESTS / "identify")
"""Folders besides that of a script where it finds modules."""


@dataclass(frozen=True, kw_only=True)
class Entry:
    """A measured block of a page.

    Attributes:
        name: of the block. page, section: where it stands. command: makes it, from the
            root of a clone; empty if none was kept.
        minutes: about, on one machine. small: the same command at a size of seconds.
        gate: "site" or "thorough": the mark under which ``test_measured_numbers.py``
            runs ``small``; or the test file that flies rows of the table itself.
        way: "prints" (Markdown tables on the standard output), "writes" (its part of
            the page) or "compares" (a test that fails if fresh flights differ from the
            page).
        elsewhere: why this command is not run by ``make numbers``; empty if it is.
        continues: file or folder with which an interrupted command continues itself; of
            another tree it is removed.
    """

    name: str
    page: str
    section: str
    command: str = ""
    minutes: float = 0.0
    small: str = ""
    gate: str = ""
    way: str = "prints"
    elsewhere: str = ""
    continues: str = ""


@cache
def entries() -> Mapping[str, Entry]:
    """Every measured block by its name."""
    return {
        name: Entry(name=name, **row)
        for name, row in tomllib.loads(TABLES.read_text("utf-8")).items()
    }


def blocks(text: str) -> dict[str, str]:
    """Content of the measured blocks of a page by their names."""
    return dict(BLOCK.findall(text))


def unwrapped(body: str) -> str:
    """Content of a block with its last paragraph on one line."""
    begin = body.rfind("\n\n") + 2
    return body[:begin] + " ".join(body[begin:].split()) + "\n"


def tables(text: str) -> list[list[str]]:
    """Tables of a text, as lines."""
    found: list[list[str]] = [[]]
    for line in text.splitlines():
        if line.startswith("|"):
            found[-1].append(line.rstrip())
        elif found[-1]:
            found.append([])
    return [each for each in found if len(each) > 1 and RULE.match(each[1])]


def heads(text: str) -> list[str]:
    """First lines of the tables of a text."""
    return [" ".join(each[0].split()) for each in tables(text)]


def modules(script: Path) -> set[Path]:
    """A script and the modules beside it and of the tests that it imports, at any
    depth.
    """
    found, left = set[Path](), [script]
    while left:
        path = left.pop()
        if path in found or not path.is_file():
            continue
        found.add(path)
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            names = (
                [node.module]
                if isinstance(node, ast.ImportFrom) and node.module
                else []
            )
            names += (
                [f"{node.module}.{each.name}" for each in node.names]
                if isinstance(node, ast.ImportFrom)
                else []
            )
            names += (
                [each.name for each in node.names]
                if isinstance(node, ast.Import)
                else []
            )
            places = [
                room / Path(*name.split("."))
                for name in names
                for room in (path.parent, *ROOMS)
            ]
            left += [place.with_suffix(".py") for place in places]
    return found


@cache
def source_digest() -> str:
    """Digest of the library's source."""
    return digest_of(
        path
        for path in (ROOT / "src").rglob("*")
        if "__pycache__" not in path.parts and path.is_file()
    )


def digest_of(paths: Iterable[Path]) -> str:
    """Digest of files and their names."""
    whole = hashlib.sha256()
    for path in sorted(paths):
        content = path.read_bytes()
        whole.update(
            f"{path.relative_to(ROOT).as_posix()}\n{len(content)}\n".encode() + content
        )
    return whole.hexdigest()[:16]


def digest(entry: Entry) -> str:
    """Digest of what an entry's numbers depend on: the library, its scripts and the
    command.
    """
    scripts = {
        path for name in SCRIPT.findall(entry.command) for path in modules(ROOT / name)
    }
    if entry.way == "writes":
        scripts |= modules(TESTS / "website" / "envelope_of_laws.py")
    return hashlib.sha256(
        f"{source_digest()} {digest_of(scripts)} {entry.command}".encode()
    ).hexdigest()[:16]


def record(entry: Entry) -> dict[str, Any] | None:
    """What was kept of the last run of an entry; None if it is of another tree, or
    there is none.
    """
    file = KEPT / f"{entry.name}.json"
    found: dict[str, Any] | None = (
        json.loads(file.read_text("utf-8")) if file.is_file() else None
    )
    return found if found is not None and found["digest"] == digest(entry) else None


def last_line(version: str, machine: str, command: str) -> str:
    """Last paragraph of a block: who measured it, where, and how."""
    line = f"skyarm {version}, {machine}, `{command}`."
    return (
        textwrap.fill(line, WIDTH, break_long_words=False, break_on_hyphens=False)
        + "\n"
    )


def with_tables(body: str, fresh: str) -> str:
    """Text with its tables replaced, in order, by those of another; comments stay, by
    which tests find the tables.
    """
    new = ["\n".join(each) for each in tables(fresh)]
    rows = re.split(r"((?:^\|.*\n)+)", body, flags=re.M)
    if len(rows[1::2]) != len(new):
        raise ValueError(f"{len(new)} tables for {len(rows[1::2])}")
    rows[1::2] = [f"{each}\n" for each in new]
    return "".join(rows)


def filled(page: str, entry: Entry, kept: Mapping[str, Any]) -> str:
    """A page with the block of an entry as it was measured."""
    old = blocks(page)[entry.name]
    body = old[: old.rfind("\n\n") + 1]
    if entry.way == "prints":
        body = with_tables(body, kept["tables"])
    last = last_line(kept["version"], kept["machine"], entry.command)
    new = f"{body.rstrip()}\n\n{last}"
    whole = f"<!-- measured: {entry.name} -->\n{new}<!-- /measured -->"
    return BLOCK.sub(lambda found: whole if found[1] == entry.name else found[0], page)


def write_page(entry: Entry, kept: Mapping[str, Any]) -> None:
    """Write a block into its page."""
    from skyarm.records.files import write_atomically

    path = DOCS / entry.page
    text = path.read_text("utf-8")
    if (new := filled(text, entry, kept)) != text:
        write_atomically(path, new.encode())


def arguments(command: str) -> list[str]:
    """Words of a command, with this Python for ``python``, ``skyarm`` and
    ``pytest``.
    """
    first, *rest = shlex.split(command)
    python = [sys.executable]
    return {
        "python": python,
        "skyarm": [*python, "-m", "skyarm"],
        "pytest": [*python, "-m", "pytest", "-n", "0"],
    }.get(first, [first]) + rest


def run(command: str, timeout: float | None = None) -> subprocess.CompletedProcess[str]:
    """Run a command in the root of the clone; the standard error is shown as it
    comes.
    """
    paths = [str(ROOT / "src"), *filter(None, [os.environ.get("PYTHONPATH", "")])]
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join(paths),
        "PYTHONUNBUFFERED": "1",
    }
    return subprocess.run(
        arguments(command),
        cwd=ROOT,
        env=environment,
        stdout=subprocess.PIPE,
        text=True,
        check=False,
        timeout=timeout,
    )


def machine() -> str:
    """Processor and cores of this machine."""
    sys.path.append(str(TESTS / "studies" / "bench"))
    from bench_timing import describe

    about = describe()
    return f"{about['processor']} ({about['cores']} cores)"


def prepare(entry: Entry) -> None:
    """Remove what the command would continue of another tree."""
    begun, now = KEPT / f"{entry.name}.begun", digest(entry)
    if entry.continues and (not begun.is_file() or begun.read_text("utf-8") != now):
        left = ROOT / entry.continues
        if left.is_dir():
            shutil.rmtree(left)
        left.unlink(missing_ok=True)
        (ROOT / entry.continues).parent.mkdir(parents=True, exist_ok=True)
    begun.write_text(now, "utf-8")


def measure(group: Sequence[Entry]) -> str:
    """Run the command of these entries and write their blocks; what went wrong, or
    nothing.

    Only entries of other ways than "prints" share a command.
    """
    import skyarm
    from skyarm.records.files import write_atomically

    first, begin = group[0], time.monotonic()
    before = {each.name: digest(each) for each in group}
    prepare(first)
    done = run(first.command)
    if done.returncode:
        return f"exit code {done.returncode}\n{done.stdout[-2000:]}"
    found = tables(done.stdout)
    page = (DOCS / first.page).read_text("utf-8")
    if first.way == "prints" and heads(done.stdout) != heads(blocks(page)[first.name]):
        return f"prints other columns than those of the page: {heads(done.stdout)}"
    kept = {
        "version": skyarm.__version__,
        "machine": machine(),
        "command": first.command,
        "seconds": round(time.monotonic() - begin, 1),
        "tables": "\n\n".join("\n".join(each) for each in found),
    }
    for entry in group:
        own = kept | {"digest": before[entry.name]}
        write_atomically(
            KEPT / f"{entry.name}.json", (json.dumps(own, indent=1) + "\n").encode()
        )
        write_page(entry, own)
    return ""


def chosen(only: Sequence[str]) -> list[Entry]:
    """Entries that this machine can measure, or those that are named.

    Raises:
        SystemExit: a name that no table has, or of a table that is made elsewhere.
    """
    for name in only:
        if name not in entries():
            raise SystemExit(f"--only {name}: must be one of {', '.join(entries())}")
        if entries()[name].elsewhere:
            raise SystemExit(f"--only {name}: {entries()[name].elsewhere}")
    return [
        each
        for each in entries().values()
        if not each.elsewhere and (not only or each.name in only)
    ]


def show(state: str, entry: Entry) -> None:
    """Line of the list."""
    print(f"{state:9} {entry.name:28} {entry.minutes:6g} min  {entry.command}")


def main(words: Sequence[str] | None = None) -> int:
    """Measure what is stale; exit code 1 if a command failed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--only", nargs="+", default=[], metavar="NAME", help="these tables"
    )
    parser.add_argument(
        "--list",
        action="store_true",
        help="show the state of every table, and run nothing",
    )
    parser.add_argument(
        "--again", action="store_true", help="run also what was run for this tree"
    )
    given = parser.parse_args(words)
    if given.list:
        for entry in entries().values():
            show(
                (
                    "elsewhere"
                    if entry.elsewhere
                    else "fresh"
                    if record(entry)
                    else "stale"
                ),
                entry,
            )
        return 0
    KEPT.mkdir(parents=True, exist_ok=True)
    groups: dict[str, list[Entry]] = {}
    for entry in chosen(given.only):
        if (kept := record(entry)) and not given.again:
            write_page(entry, kept)  # a kill may have come between record and page
        else:
            groups.setdefault(entry.command, []).append(entry)
    print(
        f"{len(groups)} commands, about"
        f" {sum(each[0].minutes for each in groups.values()):g} minutes",
        flush=True,
    )
    failed = []
    for at, (command, group) in enumerate(groups.items(), 1):
        names, begin = ", ".join(each.name for each in group), time.monotonic()
        print(
            f"{at} of {len(groups)}  {names}: {command}, about {group[0].minutes:g}"
            " minutes",
            flush=True,
        )
        wrong = measure(group)
        failed += [names] if wrong else []
        print(
            f"    {'FAILED: ' + wrong if wrong else 'done'} after"
            f" {time.monotonic() - begin:.0f} s",
            flush=True,
        )
    if failed:
        print(f"failed: {'; '.join(failed)}")
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
