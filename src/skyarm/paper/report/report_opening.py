"""What the report opens with: a small film of its own flights where there is one, else a picture of them."""

from __future__ import annotations

import base64
from dataclasses import dataclass

from skyarm.paper.report.report_markup import text

FILM = "film.webp"
"""Name of the film's file beside the report."""

MOST_FILM = 1_500_000
"""Bytes of a film that is put into the page; a larger one stays a file beside it."""


@dataclass(frozen=True, kw_only=True)
class Opening:
    """The first thing one sees.

    Attributes:
        picture: PNG. caption: what the picture shows.
        film: WebP, or nothing. film_caption: what the film shows.
    """

    picture: bytes
    caption: str
    film: bytes = b""
    film_caption: str = ""


def opening_html(opening: Opening | None) -> str:
    """HTML of it. Who prefers pictures that do not move, and a printer, gets the picture in place of the film."""
    if opening is None:
        return ""
    still = _figure("single opening", "png", opening.picture, opening.caption)
    if not 0 < len(opening.film) <= MOST_FILM:
        return still
    return f'<div class="moves">{_figure("film opening", "webp", opening.film, opening.film_caption)}{still}</div>'


def _figure(kind: str, form: str, content: bytes, caption: str) -> str:
    data = base64.b64encode(content).decode("ascii")
    image = f'<img src="data:image/{form};base64,{data}" alt="{text(caption)}">'
    return f'<figure class="{kind}">{image}<figcaption>{text(caption)}</figcaption></figure>'
