"""A scene of the studio without a browser: it keeps what its nodes were told."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np


class Node(SimpleNamespace):
    """Counts what is written to it."""

    def __setattr__(self, name: str, value: Any) -> None:
        self.__dict__["writes"] = self.__dict__.get("writes", 0) + 1
        self.__dict__[name] = np.array(value)


class Scene:
    """A scene without a browser: nodes by their names, each with the vertices or points that it was ``given``."""

    def __init__(self) -> None:
        self.nodes: dict[str, Node] = {}

    def __getattr__(self, _name: str) -> Any:
        def add(name: str = "", *given: Any, position: Any = (0.0, 0.0, 0.0), **_: Any) -> Node:
            node = self.nodes.setdefault(name or "", Node())
            removed = {"remove": lambda: self.nodes.pop(name, None)}
            node.__dict__.update(given=given[0] if given else None, position=np.array(position), **removed)
            return node

        return add
