"""The vehicle of the page on vehicle files, as a document and written again."""

from __future__ import annotations

import tomllib
from pathlib import Path

DOCUMENT = tomllib.loads(
    next(
        block
        for block in (
            (Path(__file__).parents[2] / "docs" / "vehicle_files.md")
            .read_text(encoding="utf-8")
            .split('```toml title="example.toml"\n')
        )
        if 'name = "example"' in block
    ).split("```")[0]
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
