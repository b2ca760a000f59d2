"""Every public name has an example on its page of the API; the cheap ones run and print
what they show.
"""

from __future__ import annotations

import doctest
from pathlib import Path

import pytest
from api_examples import EXAMPLES, PREPARED, shown_example
from site_reference import reference_pages

import skyarm

NAMES = sorted(set(skyarm.__all__) - {"__version__"})


def test_every_public_name_has_an_example_and_no_other() -> None:
    assert sorted(EXAMPLES) == NAMES


def test_the_pages_show_the_examples_below_their_names() -> None:
    pages = "\n".join(reference_pages().values())
    assert all(shown_example(name) in pages for name in NAMES)
    assert "+SKIP" not in pages


@pytest.fixture(scope="module")
def prepared() -> dict[str, object]:
    names: dict[str, object] = {}
    for example in doctest.DocTestParser().get_examples(PREPARED):
        exec(example.source, names)
    return names


def wrong_lines(name: str, text: str, names: dict[str, object]) -> str:
    """Report of an example that prints otherwise than it shows; empty for a true
    one.
    """
    options = (
        doctest.ELLIPSIS
        | doctest.NORMALIZE_WHITESPACE
        | doctest.IGNORE_EXCEPTION_DETAIL
    )
    runner, told = doctest.DocTestRunner(optionflags=options), list[str]()
    runner.run(
        doctest.DocTestParser().get_doctest(text, dict(names), name, None, 0),
        out=told.append,
    )
    return "".join(told)


@pytest.mark.parametrize("name", NAMES)
def test_an_example_prints_what_it_shows(
    name: str,
    prepared: dict[str, object],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert wrong_lines(name, EXAMPLES[name] + "\n", prepared) == ""


def test_a_wrong_example_is_found(prepared: dict[str, object]) -> None:
    assert "Expected" in wrong_lines("wrong", ">>> len([1])\n2\n", prepared)
