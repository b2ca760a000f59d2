"""Words and sizes that can be counted: first lines of docstrings, names of functions,
lines and bytes of the pages.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

import skyarm

ROOT = Path(__file__).resolve().parents[2]
SOURCE = Path(skyarm.__file__).parent
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.rglob("*.md"))

LONGEST = 120
"""Letters of a first line."""
OF_PEOPLE = (
    "told, tells, heard, hears, felt, feels, says, said, asked, asks, believe,"
    " believes, believed, bears, borne, knows, known to, gives way, give way, given"
    " way, nobody, of one's own, someone's own, gone on, foretold, wish, wished, led,"
    " trusted, wanted, stands for, stands in, stands beside, stands behind, stands"
    " there"
)
"""Verbs of people where a textbook has a word for a signal, a model or a load:
received, measured, desired, nominal."""
PEOPLE = re.compile(rf"\b({'|'.join(OF_PEOPLE.split(', '))})\b", re.IGNORECASE)
CLAUSE = re.compile(r"(What|Who|Whose|Where|How|Whether|Whatever|That|Those|Of)\b")
"""Beginnings of a clause in place of a noun."""
PARTICIPLE = re.compile(r"_?[a-z]+(?:ed|en|own|ught|eld|aid|ade)")
NO_PARTICIPLES = {
    "feed",
    "field",
    "hidden",
    "markdown",
    "offscreen",
    "reseed",
    "seed",
    "shorten",
    "speed",
    "widen",
}
"""Nouns and verbs that end as participles do."""

PARTICIPLES = {
    "checked",
    "completed",
    "coupled",
    "ended",
    "filtered",
    "gripped",
    "learned",
    "logged",
    "needed",
    "normalized",
    "renormalized",
    "shaped",
    "shifted",
    "shown",
    "succeeded",
}
"""Bare participles that are names of functions today; a new function is a verb or the
quantity that it returns."""


def wrong_with(line: str) -> str | None:
    """Fault of a first line of a docstring; None for a good one. Code in double
    backticks is not counted.
    """
    words = re.sub(r"``[^`]*``", "", line)
    if len(line) > LONGEST:
        return f"has {len(line)} letters: at most {LONGEST}"
    if not line.endswith("."):
        return "must end with a period"
    if found := PEOPLE.search(words):
        return f"{found[0]!r} is a verb of people: use the textbook's word"
    if found := CLAUSE.match(words):
        return f"begins with {found[0]!r}: must be a noun phrase or a verb"
    return None


DIALECT = re.compile(r"\b(?:of your own|mine)\b|\bseen[.:]")
"""Words of starter files that the textbook does not have."""


def test_starter_files_have_the_words_of_the_textbook() -> None:
    starters = [*(SOURCE / "cli/starters").glob("*.txt")]
    assert starters
    for path in starters:
        text = path.read_text("utf-8")
        assert [
            found[0] for words in (PEOPLE, DIALECT) for found in words.finditer(text)
        ] == [], path.name
        if path.name.endswith(".py.txt"):
            for line, first in first_lines(ast.parse(text)):
                assert wrong_with(first) is None, f"{path.name}:{line}: {first}"


RIDDLES = re.compile(
    r"\b(?:wrong plants?|bought with|knows nothing|bears|believes|believed(?! =))\b"
)
"""Words that no printed line has, for perturbed plants, tolerates, nominal; a file has
``believed = true``."""


def test_printed_lines_have_the_words_of_the_textbook() -> None:
    found = []
    for name, tree in trees().items():
        nodes = [
            node for node in ast.walk(tree) if isinstance(node, ast.Expr | ast.Constant)
        ]
        # of readers of the source
        texts = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
        printed = (
            node
            for node in nodes
            if isinstance(node, ast.Constant) and id(node) not in texts
        )
        lines = [
            each.value
            for each in printed
            if isinstance(each.value, str) and " " in each.value
        ]
        found += [(name, line) for line in lines if RIDDLES.search(line)]
    assert found == []


def first_lines(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Line number and summary (first paragraph, as one line) of every docstring of a
    module.
    """
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and (
            text := ast.get_docstring(node)
        ):
            yield node.body[0].lineno, " ".join(text.partition("\n\n")[0].split())


def functions(tree: ast.Module) -> set[str]:
    """Names of the functions and methods of a module, without a leading underscore."""
    return {
        node.name.removeprefix("_")
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef)
    }


@cache
def trees() -> dict[str, ast.Module]:
    """Modules of the library; parsed when a test asks, since every process of the tests
    imports this file.
    """
    return {
        path.relative_to(SOURCE).as_posix(): ast.parse(path.read_text("utf-8"))
        for path in sorted(SOURCE.rglob("*.py"))
    }


def test_first_lines_are_sentences_in_the_words_of_the_field() -> None:
    found = [
        f"{name}:{number}: {line!r} {wrong}"
        for name, tree in trees().items()
        for number, line in first_lines(tree)
        if (wrong := wrong_with(line))
    ]
    assert found == []


def test_no_new_function_is_named_by_a_bare_participle() -> None:
    found = {
        name
        for tree in trees().values()
        for name in functions(tree) - NO_PARTICIPLES
        if PARTICIPLE.fullmatch(name)
    }
    assert found <= PARTICIPLES


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("What a plant is given.", "begins with 'What'"),
        ("Whether it flies.", "begins with 'Whether'"),
        ("Reference that the law is told.", "'told'"),
        ("Force that the tip feels.", "'feels'"),
        ("Mass matrix", "period"),
        (f"{'A ' * 60}.", "letters"),
        ("Speed command after which the speed is ``wanted``.", None),
        ("Mass matrix of the floating base and its arm.", None),
        ("Whole-body momentum.", None),
    ],
)
def test_a_wrong_line_is_found_and_a_good_one_passes(
    line: str, words: str | None
) -> None:
    wrong = wrong_with(line)
    assert wrong == words if words is None else words in (wrong or "")


def test_a_participle_is_found_and_a_noun_passes() -> None:
    names = functions(
        ast.parse(
            "def joined(): ...\ndef _led(): ...\ndef speed(): ...\ndef"
            " mass_matrix(): ..."
        )
    )
    assert {name for name in names - NO_PARTICIPLES if PARTICIPLE.fullmatch(name)} == {
        "joined",
        "led",
    }


LETTERS = 100
"""Longest line of a page, in prose and code; rows of tables, pictures, marks and
formulas take what they need."""


def long_lines(text: str) -> list[int]:
    """Numbers of the lines of a page that are too long."""
    free = r"^```math\n.*?^```$|^<!-- the envelope: .*?^<!-- /the envelope -->$"
    lines = re.sub(free, _blank, text, flags=re.M | re.S).splitlines()
    return [
        k
        for k, line in enumerate(lines, 1)
        if len(line) > LETTERS and not line.startswith(("|", "![", "[![", "<!--"))
    ]


def _blank(found: re.Match[str]) -> str:
    """As many lines, all empty."""
    return "\n" * found[0].count("\n")


@pytest.mark.parametrize(
    "page", [*PAGES, ROOT / "CONTRIBUTING.md"], ids=lambda page: page.name
)
def test_lines_of_a_page_fit_a_screen(page: Path) -> None:
    assert long_lines(page.read_text("utf-8")) == []


def test_a_long_line_is_found() -> None:
    long = "x" * (LETTERS + 1)
    assert long_lines(
        f"{long}\n| {long} |\n```python\n{long}\n```\n```math\n{long}\n```\n"
    ) == [1, 4]


def test_the_front_door_stays_short() -> None:
    assert (ROOT / "README.md").stat().st_size <= 8192
