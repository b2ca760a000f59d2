"""Notebooks as Python files: cells begin with ``# %%``, those of text with ``# %%
[markdown]``.

A file is run cell by cell in one namespace, as a notebook is: what a cell prints, the
value of its last line and a figure stand below it.
"""

from __future__ import annotations

import ast
import contextlib
import io
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

HEAD = re.compile(r"^# %%(?: \[(\w+)\])?[ \t]*$", re.M)


@dataclass(frozen=True)
class Cell:
    """A cell: its text, whether it is words or code, and the line of the file at which
    the text begins.
    """

    text: str
    words: bool
    line: int


@dataclass(frozen=True)
class Shown:
    """What a cell leaves below it: text, and figures as SVG."""

    text: str = ""
    figures: tuple[str, ...] = ()


def cells(source: str) -> list[Cell]:
    """Cells of a file; ValueError for text before the first of them."""
    heads = list(HEAD.finditer(source))
    if not heads or source[: heads[0].start()].strip():
        raise ValueError("must begin with a cell: '# %%' or '# %% [markdown]'")
    found = []
    for head, after in zip(heads, [*heads[1:], None], strict=True):
        body = source[head.end() + 1 : after.start() if after else len(source)]
        if head[1] == "markdown":
            lines = [re.sub(r"^# ?", "", line) for line in body.splitlines()]
            found.append(Cell("\n".join(lines).strip(), True, 0))
        else:
            found.append(
                Cell(body.strip("\n"), False, source[: head.end()].count("\n") + 2)
            )
    return found


def run_cell(cell: Cell, names: dict[str, Any], file: str) -> Shown:
    """Run a cell of code; the value of a last line that is an expression is shown, a
    figure as a picture.
    """
    tree = ast.parse("\n" * (cell.line - 1) + cell.text, file)
    last = (
        tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    )
    told = io.StringIO()
    value = None
    with contextlib.redirect_stdout(told):
        exec(compile(tree, file, "exec"), names)
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), file, "eval"), names)
    if hasattr(value, "savefig"):
        return Shown(told.getvalue(), (svg_of(value),))
    words = "" if value is None else f"{value!r}\n"
    return Shown(told.getvalue() + words)


def svg_of(figure: Any) -> str:
    """A Matplotlib figure as SVG, letters as outlines, with the same text from run to
    run.
    """
    import matplotlib

    with io.StringIO() as file, matplotlib.rc_context({"svg.hashsalt": "skyarm"}):
        figure.savefig(file, format="svg", metadata={"Date": None})
        return file.getvalue()


def run_script(path: Path) -> list[tuple[Cell, Shown]]:
    """Run a file; each of its cells and what it leaves."""
    names: dict[str, Any] = {"__name__": "__main__"}
    return [
        (cell, Shown() if cell.words else run_cell(cell, names, str(path)))
        for cell in cells(path.read_text("utf-8"))
    ]


def rendered(ran: list[tuple[Cell, Shown]], name: str) -> tuple[str, dict[str, str]]:
    """The page of a file that was run, and its pictures by their names beside it."""
    parts, pictures = [], dict[str, str]()
    for cell, shown in ran:
        if cell.words:
            parts.append(cell.text)
            continue
        parts.append(f"```python\n{cell.text}\n```")
        if shown.text:
            parts.append(f"```text\n{shown.text.rstrip()}\n```")
        for svg in shown.figures:
            picture = f"{name}_{len(pictures) + 1}.svg"
            pictures[picture] = svg
            parts.append(f"![What the cell above draws]({picture})")
    return "\n\n".join(parts) + "\n", pictures
