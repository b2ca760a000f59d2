"""Formulas in TeX as MathML, which browsers draw by themselves, without a script and without the network.

A formula stands in a fence of the language ``math``, or in a line between dollar signs and backticks; both are what
GitHub draws, too.
"""

from __future__ import annotations

import re

BLOCK = re.compile(r"^```math\n(.*?)\n```$", re.M | re.S)
INLINE = re.compile(r"\$`([^`\n]+)`\$")


def formulas(text: str) -> list[str]:
    """Every formula of a page, in TeX: blocks, then those in lines."""
    return [found.strip() for found in BLOCK.findall(text)] + INLINE.findall(BLOCK.sub("", text))


def mathml(tex: str, display: str) -> str:
    """A formula as a ``math`` element; ValueError if it is not understood as a whole."""
    from latex2mathml.converter import convert

    made = re.sub(r"\s+", " ", convert(tex, display=display))
    # a command that is not known is handed on as its own text
    if "\\" in made or "merror" in made:
        raise ValueError(f"formula not understood: {tex}")
    # TeX spaces a name that is called as a function, and nothing here stretches but brackets
    return made.replace("|", "&#x7C;").replace("*", "&#x2A;").replace("_", "&#x5F;")


def with_mathml(text: str) -> str:
    """A page with its formulas as MathML."""
    if "math\n" not in text and "$`" not in text:
        return text
    text = BLOCK.sub(lambda found: f'<div class="formula">{mathml(found[1].strip(), "block")}</div>', text)
    return INLINE.sub(lambda found: mathml(found[1], "inline"), text)
