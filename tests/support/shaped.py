"""Files of vehicles with shapes that touch."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any


def shaped(
    folder: Path, shapes: Iterable[Mapping[str, Any]], airframe: str = "hummingbird"
) -> str:
    """Name of a vehicle file in a folder: a shipped vehicle with shapes."""
    lines = ["schema = 1", 'name = "shaped"', f'airframe = "{airframe}"']
    for i, shape in enumerate(shapes):
        lines += ["[[collisions]]", f'name = "s{i}"']
        # what JSON writes of texts and lists of numbers is TOML, too
        lines += [f"{key} = {json.dumps(value)}" for key, value in shape.items()]
    (folder / "shaped.toml").write_text("\n".join(lines), encoding="utf-8")
    return "shaped.toml"
