"""The envelope as one page that needs no other file, and its picture."""

from __future__ import annotations

from collections.abc import Mapping, Sized
from html import escape
from typing import Any

from skyarm.compare.envelope_tables import (
    MEANING,
    RULES,
    VIOLATION_HEAD,
    axis_head,
    axis_rows,
    axis_title,
    no_violation,
    summary_head,
    summary_rows,
    violation_rows,
)
from skyarm.figures.comparison_figures import envelope_figure
from skyarm.figures.style import image_bytes
from skyarm.files import versions
from skyarm.pages import details, image, page, section, table

DPI = 160

CAPTION = "Error of every law along every axis, mm. A cross in the band at the top is a law that is lost there"

HOW = (
    "Trials of {seconds}; motions grow from rest between 2 and 5 s. Perfect state, or where an axis is noisy "
    "1 mm, 1 cm/s, 2 mrad, 0.01 rad/s, joints 1 mrad, and measurements 5 ms old, of which laws that can are told. "
    "Another vehicle than the paper's is given forces and payloads by its weight, accelerations by its thrust margin "
    "where that is smaller, and swings of the arm by its joints' limits."
)


def envelope_picture(found: Mapping[str, Any]) -> bytes:
    """PNG of every axis."""
    return image_bytes(envelope_figure(found["axes"], found["laws"]), dpi=DPI)


def envelope_page(found: Mapping[str, Any], picture: bytes) -> str:
    """HTML of sentences, picture, tables and violations."""
    body = [section("In a sentence", _sentences(found) + _note(MEANING))]
    body.append(image(CAPTION, CAPTION, picture, wide=True))
    axes, laws = found["axes"], found["laws"]
    body.append(section("Where each law is good", table(_numbers(summary_head(laws)), summary_rows(axes, laws))))
    rows = violation_rows(found["violations"])
    told = table(_numbers(VIOLATION_HEAD, 2), rows) if rows else f"<p>{escape(no_violation(laws))}</p>"
    body.append(section("Violations", _note(RULES) + told))
    maps = "".join(
        table(_numbers(axis_head(axis)), axis_rows(axis), axis_title(name, axis)) for name, axis in axes.items()
    )
    body.append(section("Axis by axis", _note(HOW.format(seconds=_seconds(axes))) + maps))
    facts = f"{_counted(laws, 'law', 'laws')}, {_counted(axes, 'axis', 'axes')}, seed {found['seed']}"
    facts += f", plant {found['plant']}"
    return page(f"The envelope of {found['vehicle']}", f"{facts}; skyarm {versions()['skyarm']}", "\n".join(body))


def envelope_section(found: Mapping[str, Any], address: str) -> str:
    """HTML of sentences, picture and summary for another page; ``address`` of the envelope's own is relative."""
    axes, laws = found["axes"], found["laws"]
    link = f'<p><a href="{escape(address)}">Axis by axis, and what violates the rules</a>.</p>'
    picture = image(CAPTION, CAPTION, envelope_picture(found))
    told = details("Where each law is good", table(_numbers(summary_head(laws)), summary_rows(axes, laws)))
    return f'{_sentences(found)}{_note(MEANING)}<div class="single">{picture}</div>{told}{link}'


def _seconds(axes: Mapping[str, Any]) -> str:
    """How long the trials were flown."""
    return " and ".join(f"{each:g} s" for each in sorted({axis["window_s"][1] for axis in axes.values()}))


def _counted(things: Sized, one: str, many: str) -> str:
    """So many of something."""
    return f"{len(things)} {one if len(things) == 1 else many}"


def _numbers(head: list[str], text: int = 1) -> list[str]:
    """Heads of columns of numbers, behind so many of text."""
    return [*head[:text], *(f">{name}" for name in head[text:])]


def _sentences(found: Mapping[str, Any]) -> str:
    told = [f"<p><b>{escape(law)}</b> keeps the tip {escape(words)}</p>" for law, words in found["sentences"].items()]
    told += [f"<p>{escape(law)} does not fly: {escape(why)}</p>" for law, why in found["not_flown"].items()]
    return "".join(told)


def _note(words: str) -> str:
    return f'<p class="note">{escape(words)}</p>'
