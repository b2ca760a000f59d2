"""What modules may take from each other."""

from __future__ import annotations

import ast
from pathlib import Path

import skyarm

SOURCES = sorted(Path(skyarm.__file__).parent.rglob("*.py"))


def private_imports(path: Path) -> list[str]:
    """Underscored names that a file imports from another module."""
    found = []
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.ImportFrom):
            module = node.module or ""
            names = [alias.name for alias in node.names] + module.split(".")
            found += [f"{path.name}: {module}.{name}" for name in names if name.startswith("_") and name[:2] != "__"]
    return found


def test_no_module_imports_a_private_name_of_another():
    assert len(SOURCES) > 100
    assert [found for path in SOURCES for found in private_imports(path)] == []
