"""The page of ``skyarm margins --html``: Nyquist diagrams in hover, and every loop in a table."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from skyarm.cli.loop_margin_table import loop_rows
from skyarm.files import write_atomically
from skyarm.pages import image, page, section, table

DPI = 150

WORDS = (
    "<p>The disk margin is how far gain and phase of a loop may change together, from 0 (unstable) to 2: gain and "
    "phase (degrees) are what it leaves of each alone, rad/s is where the loop is most delicate, delay the dead time "
    "(ms) that this loop alone bears, together the disk margin of all loops of its kind under factors of their own. "
    "Each number is the smallest of all instants.</p>"
)

CAPTION = (
    "The weakest loop of each kind in hover, cut one at a time, the others closed; dashed: negative frequencies. The "
    "curve stays out of the red disk around -1 (a half plane at a margin of 2), and touches it at the frequency said."
)


def write_page(found: Any, loci: Any, file: Path) -> Path:
    """Write the page of some evidence, whole or not at all.

    Args:
        found: of :func:`skyarm.stability.along.evidence`.
        loci: of :func:`skyarm.stability.along.hover_loci`.
        file: ends with .html.
    """
    return write_atomically(file, margins_page(found, loci).encode())


def margins_page(found: Any, loci: Any) -> str:
    """HTML of margins: one file that needs nothing else."""
    from skyarm.figures.stability_figures import nyquist_figure
    from skyarm.figures.style import image_bytes

    body = ""
    if loci:
        names = "; ".join(f"{each.margin.name} {each.margin.disk:.2f}" for each in loci)
        picture = image_bytes(nyquist_figure(loci), dpi=DPI)
        body += section("Loops in hover", image(f"Nyquist diagrams: {names}", CAPTION, picture, wide=True))
    head, *rows = loop_rows(found, every=True)
    columns = [head[0], *(f">{name}" for name in head[1:])]
    body += section("Every loop", WORDS + table(columns, rows))
    facts = "the loop is lost in hover"
    if found.instants:
        delay, swings = (min(getattr(each, name) for each in found.instants) for name in ("delay", "swings"))
        facts = f"delay margin {1e3 * delay:.3g} ms; small swings grow from {1e3 * swings:.3g} ms on"
        facts += f"; instants: {len(found.instants)}"
    if found.left_out:
        facts += f"; disturbances are left out: {', '.join(found.left_out)}"
    return page(f"Margins of {found.controller} in {found.scenario}", facts, body)
