"""The vehicle to which the page on vehicle files links, as a document and written
again.
"""

from __future__ import annotations

import tomllib
from pathlib import Path

DOCUMENT = tomllib.loads(
    (
        Path(__file__).parents[2] / "examples" / "files" / "quad_with_link.toml"
    ).read_text("utf-8")
)


def written(value):
    """TOML text of a value (inline tables; enough for these files)."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return (
            "{"
            + ", ".join(f'"{key}" = {written(inner)}' for key, inner in value.items())
            + "}"
        )
    if isinstance(value, list):
        return "[" + ", ".join(written(inner) for inner in value) + "]"
    if isinstance(value, str):
        return f'"{value}"'
    return repr(value)


def file_of(folder, document, name="v.toml"):
    path = folder / name
    path.write_text(
        "".join(f"{key} = {written(value)}\n" for key, value in document.items()),
        encoding="utf-8",
    )
    return path
