"""skyarm: aerial manipulation. Multirotors that carry robot arms: dynamics, control,
simulation.

The names of ``__init__.pyi`` are stable. Arrays in, arrays out; SI units and radians;
quaternions wxyz, body to world.
"""

from __future__ import annotations

from functools import cache
from importlib import import_module

__version__ = "0.4.0"


@cache
def _modules() -> dict[str, str]:
    """Map each public name of the package to its defining module, by the imports in
    ``__init__.pyi``.
    """
    import ast
    from pathlib import Path

    tree = ast.parse(Path(__file__).with_suffix(".pyi").read_text("utf-8"))
    imports = (each for each in tree.body if isinstance(each, ast.ImportFrom))
    return {name.name: f"{each.module}" for each in imports for name in each.names}


def __getattr__(name: str) -> object:
    """Import a public name or subpackage on first use, so that ``import skyarm`` stays
    fast.
    """
    from importlib.util import find_spec

    if name == "__all__":
        return __dir__()
    if not name.startswith("_"):
        if _modules().get(name, "skyarm") != "skyarm":
            value = globals()[name] = getattr(import_module(_modules()[name]), name)
            return value
        if find_spec(f"skyarm.{name}") is not None:
            return import_module(f"skyarm.{name}")
    raise AttributeError(f"module 'skyarm' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted((*_modules(), "__version__"))
