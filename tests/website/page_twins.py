"""Facts that stand on two pages: the same sentence, the same number of the same thing,
the same field's meaning.

    python tests/website/page_twins.py            the worst first
    python tests/website/page_twins.py sweeps.md  those of one page

One fact has one home; another page links it. What a script writes is not counted, but a
field that a generated table explains has its home there.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from page_gates import DOCS, GENERATED, ROOT, blocks_of, cells, sentences

RUN = 12
"""Words in a row from which a text is a second copy."""
NEAR = 2 / 3
"""Fraction of the words of the shorter of two sentences with one number, or of two
meanings of one field, from which they state one fact."""
FAR = 0.4
"""The same of a number of several digits, which two things hardly share."""
SHARED = 3
"""Fewest words of two such meanings that are the same."""
COMMON = 1 / 3
"""Fraction of the pages on which a word tells nothing."""
APART = ("README.md", "data/")
"""Beginnings of names of pages that are not compared: the two doors repeat others."""

UNITS = (
    "mm|cm|km|m/s\\^2|m/s|m|ms|us|s|min|minutes?|seconds?|hours?|N m|N|kN|"
    "kg m\\^2|kg|g|rad/s|rad|deg(?:rees?)?|%|Hz|kHz|MB|GB|kB|W|V|A|times"
)
NUMBER = re.compile(rf"(?<![\w.^-])(\d[\d.,]*(?:e[-+]?\d+)?) ({UNITS})(?![\w/^])")
"""Number with its unit."""
CONFIDENCE = {("95", "%")}
"""Numbers of statistics that any page may have."""
WORD = re.compile(r"[^\W_][\w.+-]*[^\W_]|[^\W\d_]|\d")
LINK = re.compile(r"!?\[((?:[^\[\]]|\[[^\[\]]*\])*)\]\([^)]*\)")
FIELD = re.compile(r"`[\w.]+`")
ENDINGS = re.compile(r"(?<=\w{3})(?:ies|es|s|ed|ing)$")


@dataclass(frozen=True, kw_only=True)
class Text:
    """Sentence of a page or row of one of its tables, as a reader sees it."""

    page: str
    line: int
    text: str


@dataclass(frozen=True, kw_only=True)
class Twin:
    """One fact in two places."""

    kind: str
    weight: int
    first: Text
    second: Text


@dataclass(frozen=True, kw_only=True)
class Fact:
    """One fact with all its places.

    Attributes:
        kind: what is the same in the longest pair. weight: number of words that this
            pair shares, times the pages that could link the fact.
    """

    kind: str
    weight: int
    places: tuple[Text, ...]

    @property
    def pages(self) -> set[str]:
        """Names of its pages."""
        return {place.page for place in self.places}

    def lines(self) -> str:
        """Kind, and each place with its text."""
        rows = (f"    {each.page}:{each.line}: {each.text}" for each in self.places)
        return "\n".join([f"{self.kind}, on {len(self.pages)} pages", *rows])


def words(text: str) -> list[str]:
    """Words of a text in small letters."""
    return [word.lower() for word in WORD.findall(text)]


def stems(text: str) -> set[str]:
    """Words of a text without endings, to compare two ways of saying one thing; short
    words are left out.
    """
    return {
        ENDINGS.sub("", word) for word in words(text) if len(word) > 3 or word == "tip"
    }


def name_of(page: Path) -> str:
    """Name of a page as twins have it."""
    path = page.resolve()
    inside = path.is_relative_to(DOCS)
    return path.relative_to(DOCS if inside else ROOT).as_posix()


def pages() -> dict[str, str]:
    """Pages to compare, by name."""
    return {
        name_of(path): path.read_text("utf-8")
        for path in sorted(DOCS.rglob("*.md"))
        if not name_of(path).startswith(APART)
    }


def texts_of(page: str, text: str) -> Iterator[Text]:
    """Sentences of the prose and cells of the tables by hand of a page."""
    for block in blocks_of(text):
        if block.kind == "prose":
            for sentence in sentences(block, code=True):
                yield Text(page=page, line=block.line, text=sentence)
        elif block.kind == "table":
            for k, row in enumerate(block.lines[2:], 2):
                shown = (LINK.sub(r"\1", cell) for cell in cells(row))
                yield Text(page=page, line=block.line + k, text=" | ".join(shown))


def copies(texts: Iterable[Text]) -> Iterator[Twin]:
    """Texts that share a run of words with one of another page, the longest run of each
    pair.
    """
    at: dict[tuple[str, ...], list[Text]] = defaultdict(list)
    length: Counter[tuple[Text, Text]] = Counter()
    for text in texts:
        said = words(text.text)
        for k in range(len(said) - RUN + 1):
            run = tuple(said[k : k + RUN])
            for other in at[run]:
                if other.page != text.page:
                    length[other, text] += 1
            at[run].append(text)
    for (first, second), runs in length.items():
        yield Twin(kind="same words", weight=runs + RUN - 1, first=first, second=second)


def rare_words(texts: Iterable[Text]) -> Mapping[Text, set[str]]:
    """Words of each text that are not on most pages."""
    texts = list(texts)
    on: dict[str, set[str]] = defaultdict(set)
    for text in texts:
        for word in stems(text.text):
            on[word].add(text.page)
    most = max(3.0, COMMON * len({text.page for text in texts}))
    return {
        text: {word for word in stems(text.text) if len(on[word]) <= most}
        for text in texts
    }


def numbers(texts: Iterable[Text]) -> Iterator[Twin]:
    """Sentences of two pages with one number and unit, about the same thing."""
    told = rare_words(texts)
    by_number: dict[tuple[str, str], list[Text]] = defaultdict(list)
    for text in told:
        for number, unit in set(NUMBER.findall(text.text)) - CONFIDENCE:
            by_number[number.rstrip(".,"), unit].append(text)
    seen = set()
    for (number, unit), where in by_number.items():
        for first, second in pairs(where):
            both = told[first] & told[second] - stems(unit)
            least = min(len(told[first]), len(told[second]))
            short = len(number) < len("0.04")
            need = max(3, NEAR * least) if short else max(2, FAR * least)
            if len(both) >= need and (first, second) not in seen:
                seen.add((first, second))
                kind = f"{number} {unit}"
                yield Twin(kind=kind, weight=len(both), first=first, second=second)


def pairs(texts: list[Text]) -> Iterator[tuple[Text, Text]]:
    """Pairs of texts of two pages."""
    for k, first in enumerate(texts):
        for second in texts[k + 1 :]:
            if first.page != second.page:
                yield first, second


def explained(page: str, text: str) -> Iterator[tuple[str, Text]]:
    """Fields whose meaning a generated table of a page states."""
    for block in GENERATED.finditer(text):
        line = text[: block.start()].count("\n") + 1
        for k, row in enumerate(block[0].splitlines()):
            if row.startswith("| `"):
                name, *rest = cells(row)
                if FIELD.fullmatch(name):
                    said = LINK.sub(r"\1", " | ".join(rest))
                    yield name, Text(page=page, line=line + k, text=said)


def meaning(row: str) -> set[str]:
    """Words of the longest cell of a row."""
    return stems(max(row.split(" | "), key=len))


def meanings(found: Mapping[str, str]) -> Iterator[Twin]:
    """Rows of tables by hand that explain a field as a table of another page does."""
    home: dict[str, list[Text]] = defaultdict(list)
    for page, text in found.items():
        for name, row in explained(page, text):
            home[name].append(row)
    hand: dict[str, list[Text]] = defaultdict(list)
    for page, text in found.items():
        for row in texts_of(page, text):
            name, bar, rest = row.text.partition(" | ")
            if bar and FIELD.fullmatch(name):
                hand[name].append(Text(page=page, line=row.line, text=rest))
    for name, rows in hand.items():
        for k, row in enumerate(rows):
            for other in (*home[name], *rows[k + 1 :]):
                both = meaning(row.text) & meaning(other.text)
                least = min(len(meaning(row.text)), len(meaning(other.text)))
                if (
                    other.page != row.page
                    and len(both) >= SHARED
                    and len(both) >= NEAR * least
                ):
                    yield Twin(
                        kind=f"field {name}", weight=len(both), first=row, second=other
                    )
                    break


def facts(found: Mapping[str, str]) -> list[Fact]:
    """Facts of pages that stand twice, the worst first."""
    texts = [each for page, text in found.items() for each in texts_of(page, text)]
    twins = [*copies(texts), *numbers(texts), *meanings(found)]
    group: dict[Text, set[Text]] = {}
    for twin in twins:
        both = group.get(twin.first, {twin.first}) | group.get(
            twin.second, {twin.second}
        )
        group |= dict.fromkeys(both, both)
    longest: dict[Text, Twin] = {}
    for twin in sorted(twins, key=lambda twin: twin.weight):
        longest |= dict.fromkeys(group[twin.first], twin)
    places = {
        tuple(sorted(each, key=lambda text: (text.page, text.line)))
        for each in group.values()
    }
    whole = [
        Fact(
            kind=longest[of[0]].kind,
            weight=longest[of[0]].weight * (len({place.page for place in of}) - 1),
            places=of,
        )
        for of in places
    ]
    return sorted(whole, key=lambda fact: (-fact.weight, fact.lines()))


def main() -> int:
    """Print the twins of all pages, or those of the named ones."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("pages", nargs="*", help="names below docs; all if left out")
    given = parser.parse_args()
    chosen = {name.removeprefix("docs/") for name in given.pages}
    found = [fact for fact in facts(pages()) if not chosen or chosen & fact.pages]
    for fact in found:
        print(fact.lines())
    print(f"{len(found)} facts stand twice")
    return 0


if __name__ == "__main__":
    sys.exit(main())
