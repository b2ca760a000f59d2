"""Formulas in TeX as MathML, which browsers draw by themselves, without a script and
without the network.

A formula stands in a fence of the language ``math``, or in a line between dollar signs
and backticks; both are what GitHub draws, too.
"""

from __future__ import annotations

import re

BLOCK = re.compile(r"^```math\n(.*?)\n```$", re.M | re.S)
INLINE = re.compile(r"\$`([^`\n]+)`\$")
ROWS = re.compile(r"\\begin\{aligned\}\s*&(.*)\\end\{aligned\}", re.S)
"""Equations below one another; the converter would write them into one line, with the
marks of the columns."""

TOKEN = re.compile(r"\\q?quad\b|\\(?:left|right)\b|[{}]|[^{}\\]+|\\.", re.S)


def formulas(text: str) -> list[str]:
    """Every formula of a page, in TeX: blocks, then those in lines."""
    return [found.strip() for found in BLOCK.findall(text)] + INLINE.findall(
        BLOCK.sub("", text)
    )


def mathml(tex: str, display: str) -> str:
    """A formula as a ``math`` element; ValueError if it is not understood as a
    whole.
    """
    from latex2mathml.converter import convert

    # of several primes behind an index the converter sets only the first one high
    tex = re.sub("'{2,}", lambda found: "^{" + len(found[0]) * "\\prime " + "}", tex)
    made = re.sub(r"\s+", " ", convert(tex, display=display))
    # a command that is not known is handed on as its own text, and so is a mark of a
    # column
    if "\\" in made or "merror" in made or "<mi>&</mi>" in made:
        raise ValueError(f"formula not understood: {tex}")
    # TeX spaces a name that is called as a function, and nothing here stretches but
    # brackets
    return made.replace("|", "&#x7C;").replace("*", "&#x2A;").replace("_", "&#x5F;")


def rows_of(tex: str) -> list[list[str]]:
    """Rows of a block of equations, and in each the equations between wide spaces
    outside all brackets.
    """
    stacked = ROWS.fullmatch(tex)
    rows = re.split(r"\\\\\s*&", stacked[1]) if stacked else [tex]
    return [_between_wide_spaces(row) for row in rows]


def _between_wide_spaces(tex: str) -> list[str]:
    found, depth = [""], 0
    for token in TOKEN.findall(tex):
        depth += (token in ("{", "\\left")) - (token in ("}", "\\right"))
        if token.endswith("quad") and not depth:
            found.append("")
        else:
            found[-1] += token
    return [each.strip() for each in found]


def block(tex: str) -> str:
    """Equations of a block, each an element of its own: a narrow page breaks the line
    between them.
    """
    rows = ("".join(mathml(each, "block") for each in row) for row in rows_of(tex))
    return f'<div class="formula">{"".join(f"<div>{row}</div>" for row in rows)}</div>'


def with_mathml(text: str) -> str:
    """A page with its formulas as MathML."""
    if "math\n" not in text and "$`" not in text:
        return text
    text = BLOCK.sub(lambda found: block(found[1].strip()), text)
    # Markdown takes a line that begins with a math element for a block of its own
    return INLINE.sub(lambda found: f"<span>{mathml(found[1], 'inline')}</span>", text)
