"""Error and warning for machine code that is not available, with cause and remedy.

The causes: llvmlite is missing, too old for our assembly, broken, or its LLVM does not
know this processor.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from skyarm.records.files import needs_extra
from skyarm.records.files.packages import FLOORS, below_floor, installed_versions

NAME = "llvmlite"


class NoMachineCodeError(RuntimeError):
    """Error: machine code cannot be compiled on this machine."""


class SlowFlightWarning(RuntimeWarning):
    """Warning: an episode runs in Python floats, because machine code is not
    available.
    """


@contextmanager
def llvm_needed() -> Iterator[None]:
    """Turn any exception of the LLVM compiler into NoMachineCodeError.

    Only around calls of llvmlite: all that a broken library may raise is taken for a
    missing one.
    """
    try:
        yield
    except (NoMachineCodeError, MemoryError):
        raise
    except Exception as error:
        raise NoMachineCodeError(_error_text(error)) from error


def require_floor(version: str) -> None:
    """Raise RuntimeError if the installed llvmlite is too old for the generated
    assembly.
    """
    if below_floor({NAME: version}):
        raise RuntimeError("its LLVM is too old")


def _error_text(error: Exception) -> str:
    """Error message where LLVM fails: the cause, the required version and the installed
    version.
    """
    lines = str(error).strip().splitlines()
    cause = lines[0] if lines else type(error).__name__
    version = getattr(sys.modules.get(NAME), "__version__", None) or installed_versions(
        [NAME]
    ).get(NAME)
    there = f", {version} is installed" if version else ""
    return (
        f"no machine code here ({cause}): needs {NAME} {FLOORS[NAME]} or newer{there}; "
        f"python -m pip install --upgrade {NAME}"
    )


class MissingExtraError(ImportError):
    """Error: an optional library is not installed."""


def missing_extra(extra: str) -> MissingExtraError:
    """Make the error for an optional library that is not installed, with the extra that
    installs it.
    """
    return MissingExtraError(needs_extra(extra))
