"""The machine's C compiler for tests: C text into a loaded library, an object's symbols, a function's stack."""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest

from skyarm.compile.c_source import END_IEEE, KEEP_IEEE, Floats, helpers, statements
from skyarm.compile.tracing.lower import Lowered

CC = shutil.which("cc")
needs_cc = pytest.mark.skipif(CC is None, reason="no C compiler 'cc' on this machine")

STRICT = ("-Wall", "-Wextra", "-Werror", "-std=c99", "-pedantic")
CAREFUL = ("-Wconversion", "-Wshadow", "-Wdouble-promotion", "-Wmissing-prototypes", "-Wstrict-prototypes")
LIBM = {f"{name}{suffix}" for name in ("sqrt", "fabs", "floor", "copysign", "ldexp", "frexp") for suffix in ("", "f")}


def run(*command: str | Path) -> str:
    result = subprocess.run([str(c) for c in command], capture_output=True, text=True, timeout=120, check=False)
    assert result.returncode == 0, result.stderr[:4000]
    return result.stdout


def object_file(text: str, folder: Path, flags: Sequence[str] = ("-O2",), name: str = "program") -> Path:
    """Compile to an object file; any warning is a failure."""
    assert CC is not None
    source, target = folder / f"{name}.c", folder / f"{name}.o"
    source.write_text(text, encoding="ascii")
    run(CC, *STRICT, *flags, "-fPIC", "-c", source, "-o", target)
    return target


def library(text: str, folder: Path, flags: Sequence[str] = ("-O2",), name: str = "program") -> ctypes.CDLL:
    """Compile and load; linked without the compile flags, which could change the process (flush to zero)."""
    assert CC is not None
    shared = folder / f"{name}.so"
    run(CC, "-shared", object_file(text, folder, flags, name), "-lm", "-o", shared)
    return ctypes.CDLL(str(shared))


def undefined(target: Path) -> set[str]:
    """Symbols an object file needs from elsewhere."""
    if shutil.which("nm") is None:
        pytest.skip("no 'nm' on this machine")
    # what position-independent code needs is the linker's
    return set(re.findall(r"\bU _?(\w+)", run("nm", "-u", target))) - {"GLOBAL_OFFSET_TABLE_", "_GLOBAL_OFFSET_TABLE_"}


def c_function(program: Lowered, name: str, *, single: bool = False) -> str:
    """A C99 file with ``void name(const double *x, double *y)``: the program on plain arrays.

    Args:
        program: basic operations.
        name: of the function, a C identifier.
        single: float in place of double.
    """
    floats = Floats(single)
    inputs = [f"x[{i}]" for i in range(len(program.inputs))]
    outputs = [f"y[{i}]" for i in range(len(program.outputs))]
    body = statements(program, floats, name, inputs, outputs)
    signature = f"void {name}(const {floats.kind} *x, {floats.kind} *y)"
    lines = ["#include <math.h>", "", KEEP_IEEE, helpers(program, floats, name), f"{signature};", signature, "{"]
    unused = ["    (void)x;", "    (void)y;"]  # a program of constants reads nothing
    return "\n".join([*lines, *unused, *(f"    {line}" for line in body), "}", "", END_IEEE])
