"""The one console that commands write on: whatever is printed there, nothing in it is a terminal's command."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment

from skyarm.files import printable


class Terminal(Console):
    """A console on which names from files are text and nothing else.

    Every text is printed with its control characters written out, at the last place before styles and the terminal's
    own commands are added, so that no command can forget it.
    """

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Render as a console does, with printable text."""
        return _printable(super().render(renderable, options))

    def out(self, *objects: Any, **options: Any) -> None:
        """Refuse what would go past :meth:`render`."""
        raise NotImplementedError("Terminal.out: print")


def _printable(segments: Iterable[Segment]) -> Iterator[Segment]:
    for segment in segments:
        if segment.control or segment.text.isprintable():
            yield segment
        else:
            text = "\n".join(printable(line) for line in segment.text.split("\n"))
            yield Segment(text, segment.style)
