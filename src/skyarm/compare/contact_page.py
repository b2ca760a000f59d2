"""The contact suite as one page that needs no other file."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Any

from skyarm.compare.contact_flights import CONDITIONS
from skyarm.compare.contact_laws import TITLES
from skyarm.compare.contact_pictures import caption_of
from skyarm.compare.contact_tables import (
    MEANING,
    handle_head,
    handle_rows,
    laws_of,
    number_head,
    number_rows,
    success_rows,
    worlds_line,
)
from skyarm.files import versions
from skyarm.pages import image, page, section, table

HOW = (
    "Every law meets the same worlds: stiffness 500 to 1e5 N/m, friction 0.1 to 0.8 (0.28 where the tip slides "
    "sideways), the believed normal wrong by up to 10 degrees, a hinge that is up to 6 % nearer or further, half "
    "to twice the friction, damping and closer behind a handle, half to twice the mass, thrust up to 10 % less, "
    "wind of up to 2 N and never more than half the push, commands up to 10 ms late. No law is told of any of it. "
    "A law that follows positions is led 1 cm behind the believed surface."
)


def contact_page(found: Mapping[str, Any], pictures: Mapping[str, bytes] | None = None) -> str:
    """HTML of successes, pictures (PNG by task), numbers and how they came about."""
    body = [section("What flew", _note(HOW) + _note(MEANING) + _note(worlds_line(found)) + _laws(found))]
    for name, title in CONDITIONS.items():
        laws = laws_of(found, name)
        if laws:
            heads = ["task", *(f">{law}" for law in laws)]
            body.append(section(f"Successes, {title}", table(heads, success_rows(found, name))))
    if pictures:
        body.append(section("One flight of each", _note(SHOWN) + _pictures(found, pictures)))
    for name, title in CONDITIONS.items():
        if laws_of(found, name):
            first, law, *numbers, last = number_head()
            heads = [first, law, *(f">{each}" for each in numbers), last]
            body.append(section(f"Numbers, {title}", _note(MEDIANS) + table(heads, number_rows(found, name))))
    for name, title in CONDITIONS.items():
        rows = handle_rows(found, name)
        if rows:
            first, law, *numbers = handle_head()
            heads = [first, law, *(f">{each}" for each in numbers)]
            body.append(section(f"Handles, {title}", _note(HANDLE_NOTE) + table(heads, rows)))
    facts = f"{found['worlds']} worlds a task, seed {found['seed']}, plant {found['plant']}"
    return page("Tasks in contact", f"{facts}; skyarm {versions()['skyarm']}", "\n".join(body))


SHOWN = (
    "The first of the wrong worlds: forces over time, and the path of the tip with what is touched as it is at first, "
    "dashed where that is at last. The flights are in the folder flights beside this page."
)


def _pictures(found: Mapping[str, Any], pictures: Mapping[str, bytes]) -> str:
    drawn = []
    for name, png in pictures.items():
        told = found["shown"][name]
        caption = caption_of(found["tasks"][name]["title"], told)
        drawn.append(image(caption, caption, png, small=True, link=told.get("film", "")))
    return "".join(drawn)


HANDLE_NOTE = "Force along the true radius of the handle, and by how much it was behind the angle that was asked for."

MEDIANS = "Medians over the flights that came to their end; the force error by its size."


def _laws(found: Mapping[str, Any]) -> str:
    told = [f"<p><b>{escape(law)}</b>: {escape(TITLES[law])}</p>" for law in found["laws"] if law in TITLES]
    told += [f"<p>{escape(law)} does not fly: {escape(why)}</p>" for law, why in found["not_flown"].items()]
    return "".join(told)


def _note(words: str) -> str:
    return f'<p class="note">{escape(words)}</p>'
