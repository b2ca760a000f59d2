"""User code: source file and line of a function, an error or the first number that is
not finite; digests of files.
"""

from __future__ import annotations

import functools
import hashlib
import linecache
import math
import os
import sys
import traceback
import types
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from traceback import walk_tb
from typing import Any, NamedTuple, TypeAlias, TypeVar

from skyarm.records.files.messages import one_line, shown

PACKAGE = f"{os.path.dirname(os.path.dirname(os.path.dirname(__file__)))}{os.sep}"
"""Folder of the library's own code."""

PYTHON, INSTALLED = (
    f"{os.path.dirname(os.__file__)}{os.sep}",
    f"{os.sep}site-packages{os.sep}",
)
"""Folder of Python's standard library, and the folder of installed packages within
it."""

Result = TypeVar("Result")

LIBRARIES = frozenset(
    [
        "numpy",
        "scipy",
        "jax",
        "jaxlib",
        "llvmlite",
        "mujoco",
        "pyarrow",
        "typer",
        "click",
    ]
)
"""Installed libraries whose errors are reported at the user's line that called them."""

DEPTH = 8
"""Largest depth at which functions inside functions are searched for user code."""


def own_code(thing: object, depth: int = DEPTH) -> types.CodeType | None:
    """Code object of the first user-written function in an object; None if the library
    wrote them all.

    Args:
        thing: a function, a method, a partial one, an object that can be called, or a
            class.
        depth: how far functions that it was closed over are followed.
    """
    if depth == 0:
        return None
    # a partial function is the user's as soon as one of its parts is
    if isinstance(thing, functools.partial):
        parts = (thing.func, *thing.args, *thing.keywords.values())
        return next(
            (
                code
                for part in parts
                if callable(part) and (code := own_code(part, depth - 1))
            ),
            None,
        )
    thing = getattr(thing, "__func__", thing)
    # decorators of the library keep the user's function inside
    if not hasattr(thing, "__code__") and hasattr(thing, "__wrapped__"):
        return own_code(thing.__wrapped__, depth - 1)
    code = getattr(thing, "__code__", None)
    if not isinstance(code, types.CodeType):
        return _code_of_class(thing if isinstance(thing, type) else type(thing))
    if is_own(code, str(getattr(thing, "__module__", ""))):
        return code
    # a closure of the library may hold a function of the user, as a preset with a
    # user's gain does
    for inner in closed_over(thing):
        if callable(inner) and (inner_code := own_code(inner, depth - 1)) is not None:
            return inner_code
    return None


def closed_over(function: object) -> Iterator[object]:
    """Values that a closure captures, without those that are not assigned yet."""
    for cell in getattr(function, "__closure__", None) or ():
        with suppress(ValueError):
            yield cell.cell_contents


def codes_of(methods: Iterable[object]) -> Iterator[types.CodeType]:
    """Code objects of methods, properties and functions of a class."""
    for method in methods:
        # of the methods that dataclasses write some have no file, others are Python's
        # own
        code = getattr(
            getattr(method, "fget", None) or getattr(method, "__func__", method),
            "__code__",
            None,
        )
        if isinstance(code, types.CodeType):
            yield code


def _code_of_class(kind: type) -> types.CodeType | None:
    """Code object of the first method of a class or its bases that a user wrote; None
    without any.
    """
    # __call__ first, because it is what a flight calls
    for each in kind.__mro__:
        methods = vars(each)
        for code in codes_of((methods.get("__call__"), *methods.values())):
            if is_own(code, each.__module__):
                return code
    return None


def is_own(code: types.CodeType, module: str) -> bool:
    """True if code was written by the user: not by the library, Python or an installed
    package, nor generated.
    """
    file = code.co_filename
    if file.startswith("<string"):
        # what python -c runs has no file, as the methods that dataclasses write
        return module == "__main__" and not code.co_qualname.startswith("__create_fn__")
    return is_own_file(file, module)


def is_own_file(file: str, module: str) -> bool:
    """True if a module's file was written by the user: not by the library, Python or an
    installed package.
    """
    if file.startswith((PACKAGE, "<frozen")) or (
        file.startswith(PYTHON) and INSTALLED not in file
    ):
        return False
    return module.partition(".")[0] not in LIBRARIES


def is_beside(file: str, folder: str) -> bool:
    """True if a user-written file lies in a folder or below it."""
    if not file.startswith(f"{folder.rstrip(os.sep)}{os.sep}"):
        return False
    return INSTALLED not in file and not file.startswith((PACKAGE, PYTHON))


def place_of(thing: object) -> str:
    """File and line where a function, or the first method of a class, begins; its name
    if they are unknown.
    """
    code = own_code(thing) or getattr(thing, "__code__", None)
    if code is None:
        return str(getattr(thing, "__qualname__", type(thing).__qualname__))
    return f"{code.co_filename}:{code.co_firstlineno}"


def require_result(function: object, value: Result, fine: bool, allowed: str) -> Result:
    """Return the result of a user-defined function that is not traced; raise an error
    unless the result is allowed.

    Args:
        function: user's function, or one of the library's in its place.
        value: its result.
        fine: True if the result is allowed.
        allowed: allowed results in words.

    Raises:
        ValueError: it is not; one line with file, function, value and what is allowed.
    """
    if not fine:
        named = (
            f"{place_of(function)}:"
            f" {getattr(function, '__qualname__', type(function).__name__)}"
        )
        raise ValueError(f"{named} gives {shown(value)}: must be {allowed}")
    return value


class OwnCodeError(ValueError):
    """Error raised by user code in another process, as one line with file and line
    number.
    """


def failure(error: BaseException) -> str:
    """One line about an error in user code: file, line, class and text; empty for an
    error of the library.
    """
    place = place_of_error(error)
    return one_line(f"{place}: {type(error).__name__}: {error}") if place else ""


def own_failure(error: BaseException) -> str:
    """One-line text of an error raised directly by user code; empty if the library
    raised it.

    A ValueError, an OSError or an exit is of the code that raises it: the library's
    refusals pass through code of someone's own too. Of an error that the library tells
    on in words of its own, the first one counts; but what a record's own check says of
    a file's number stays the file's. A user's command may exit as it likes.
    """
    inner: BaseException | None = error
    while inner is not None:
        if not isinstance(inner, (ValueError, OSError, SystemExit)):
            # an error of another kind is no refusal, so the innermost user line is to
            # blame; as a mere cause it is one that the library expected and has told of
            return failure(inner) if inner is error else ""
        if inner is not error and str(inner) not in str(error):
            return ""
        frames = _frames(inner)
        own = [k for k, frame in enumerate(frames) if frame.own]
        # raised by the user's own line, not passed through it
        if own and own[-1] == len(frames) - 1:
            checks_record = (
                inner is not error and frames[own[0]].function == "__post_init__"
            )
            commanded = isinstance(inner, SystemExit) and frames[
                own[0] - 1
            ].module.startswith(COMMAND_LINE)
            return "" if checks_record or commanded else failure(inner)
        inner = inner.__cause__ or inner.__context__
    return ""


COMMAND_LINE = f"{os.path.basename(os.path.dirname(PACKAGE))}.cli."
"""Folder of the modules that call commands, user-defined ones included."""


def is_deliberate(error: BaseException) -> bool:
    """True if an error was raised to tell a user something, not by a mistake of the
    library's own code.

    It is a mistake where an installed package raised it, such as one that draws, or an
    operation of a line of the library without ``raise``. Python's own library tells of
    files and texts.
    """
    frames = traceback.extract_tb(error.__traceback__)
    if not frames:
        return True
    file, line = frames[-1].filename, frames[-1].line or ""
    if file.startswith(PACKAGE):
        # a source that cannot be read has no line, and gets the benefit of the doubt
        return not line or line.startswith("raise")
    return INSTALLED not in file


class StackFrame(NamedTuple):
    """Frame of an error's stack, of the user's code or of the library: function,
    module, file and line.
    """

    own: bool
    function: str
    module: str
    place: str


def _frames(error: BaseException) -> list[StackFrame]:
    """Stack frames of an error in the user's code and in the library, the outermost
    first.
    """
    frames = []
    for frame, line in walk_tb(error.__traceback__):
        code, module = frame.f_code, str(frame.f_globals.get("__name__", ""))
        own = is_own(code, module)
        if own or code.co_filename.startswith(PACKAGE):
            frames.append(
                StackFrame(own, code.co_name, module, f"{code.co_filename}:{line}")
            )
    return frames


def place_of_error(error: BaseException) -> str:
    """File and line of the innermost user code in an error's stack trace; empty without
    any.
    """
    return next((frame.place for frame in reversed(_frames(error)) if frame.own), "")


CONSTANTS = "self", "par"
"""Arguments whose numbers a period does not change; limits among them may be
infinite."""


Trace: TypeAlias = Callable[[types.FrameType, str, Any], "Trace | None"]
"""Trace function of Python: called with a frame, an event, and its value or error."""


def first_not_finite(period: Callable[[], object]) -> str:
    """First line of user code in a function called with floats that gives inf or NaN
    from finite arguments.

    Args:
        period: function that may raise; the user's own 1 / 0 is such a line.

    Returns:
        ``file.py:12 (law): name is nan``, with the variable where there is one; empty
        without such a line.
    """
    # a command begins before it is loaded (own_sources)
    from skyarm.algebra import Vec3

    lines = list[str]()
    debugger = sys.gettrace()

    def enter(frame: types.FrameType, _event: str, _value: object) -> Trace | None:
        given = (
            value for name, value in frame.f_locals.items() if name not in CONSTANTS
        )
        # an argument that is not finite came from the caller, where the first line is
        # to be found
        if not is_own(frame.f_code, frame.f_globals.get("__name__", "")) or any(
            map(_not_finite, given)
        ):
            return None
        line = frame.f_lineno
        last = ""
        begun = len(lines)
        first = dict[str, str]()

        def step(frame: types.FrameType, event: str, value: Any) -> Trace:
            nonlocal line, last
            code = frame.f_code
            place = (
                f"{Path(code.co_filename).name}:{line}"
                f" ({code.co_qualname.replace('<locals>.', '')})"
            )
            for name, each in frame.f_locals.items():
                if (isinstance(each, (float, Vec3)) or hasattr(each, "tolist")) and (
                    kind := _not_finite(each)
                ):
                    first.setdefault(kind, f"{place}: {name} is {kind}")
            if event == "exception" and issubclass(value[0], ArithmeticError):
                lines.append(f"{place}: {value[1]}")
            # a caught error is no result, and its line must not be blamed
            elif event == "return" and last != "exception":
                # what was not finite on the way to a finite result is meant
                del lines[begun:]
                if kind := _not_finite(value):
                    lines.append(first.get(kind, place))
            line, last = frame.f_lineno, event
            return step

        return step

    # the debugger's own function is put back, so that breakpoints still work
    sys.settrace(enter)
    try:
        # known to fail: only the lines are wanted here
        period()
    except Exception:
        pass
    finally:
        sys.settrace(debugger)
    return lines[0] if lines else ""


def _not_finite(value: object) -> str:
    """Worst non-finite number in a value: "nan", else "inf"; empty if all numbers are
    finite.
    """
    # a motion is judged by its state, an array by its numbers
    value = (
        value.tolist() if hasattr(value, "tolist") else getattr(value, "state", value)
    )
    if isinstance(value, float):
        return "" if math.isfinite(value) else str(abs(value))
    from skyarm.records.leaves import leaves

    parts = value if isinstance(value, list) else leaves(value)
    # as texts "nan" comes behind "inf", and both behind ""
    return max((_not_finite(part) for part in parts if part is not value), default="")


MISSING = "missing"
"""Text in place of the digest of a file that can no longer be read."""


def number_duplicates(pairs: Iterable[tuple[str, str]]) -> dict[str, str]:
    """Table of digests by file name; a second digest of one name is stored under a
    numbered name.
    """
    digests: dict[str, str] = {}
    for plain, identity in pairs:
        # numbered by its place, as the files before it have lower numbers
        name, number = plain, len(digests)
        while digests.get(name, identity) != identity:
            number += 1
            name = f"{plain} ({number})"
        digests[name] = identity
    return digests


def file_of(module: types.ModuleType | None) -> str:
    """Path of a module's file with links resolved; empty if it has none."""
    file = getattr(module, "__file__", None)
    return os.path.realpath(file) if isinstance(file, str) else ""


def identity_of(content: bytes) -> str:
    """Digest of a file's content: "sha256:..."."""
    return f"sha256:{hashlib.sha256(content).hexdigest()}"


def identity_of_file(file: str) -> str:
    """Digest of a file's present content."""
    try:
        return identity_of(Path(file).read_bytes())
    except OSError:
        return MISSING


def source_of(code: types.CodeType) -> tuple[str, str]:
    """File name and digest of the source of some code; for interactively typed code a
    digest of its lines.
    """
    file = code.co_filename
    identity = identity_of_file(file)
    if identity != MISSING:
        return Path(file).name, identity
    lines = "".join(linecache.getlines(file))  # a notebook's cell
    return "(typed in)", identity_of((lines or _bytecode_text(code)).encode())


def _bytecode_text(code: types.CodeType) -> str:
    """Text of a code object's bytecode, names and constants for a digest, equal in
    every process.
    """
    constants = [
        _bytecode_text(each) if isinstance(each, types.CodeType) else _constant(each)
        for each in code.co_consts
    ]
    return (
        f"{code.co_name} {code.co_code.hex()} {code.co_names} {code.co_varnames}"
        f" {code.co_freevars} {constants}"
    )


# the order of a set differs from process to process
def _constant(value: object) -> str:
    return (
        repr(sorted(map(repr, value))) if isinstance(value, frozenset) else repr(value)
    )
