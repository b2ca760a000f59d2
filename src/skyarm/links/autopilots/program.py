"""Program of an autopilot as a child process: found, started in a folder of its own, and always ended."""

from __future__ import annotations

import contextlib
import ctypes
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from skyarm.links.autopilots.autopilot import Autopilot, LinkError
from skyarm.records.files import shown
from skyarm.scenario.scenario_record import ScenarioError

LAST_WORDS = 400
"""Characters of a program's output that a message repeats."""


def find_program(autopilot: Autopilot, usual: str = "") -> Path:
    """Path of an autopilot's program: stated, of the environment variable, or ``usual`` if it is there.

    Raises:
        ScenarioError: none of them is an executable file.
    """
    stated = autopilot.program or os.environ.get(autopilot.variable, "")
    where = "controller.program" if autopilot.program else autopilot.variable
    if not stated:
        found = shutil.which(usual) if usual else None
        if found is None:
            raise ScenarioError(
                f"controller.program: is missing; must be the path of {autopilot.title}'s program, here or in the "
                f"environment variable {autopilot.variable}"
            )
        return Path(found)
    path = Path(stated).expanduser().absolute()
    if not path.is_file() or not os.access(path, os.X_OK):
        raise ScenarioError(f"{where} = {shown(stated)}: must be an executable file, {autopilot.title}'s program")
    return path


class Child:
    """Child process in a temporary folder of its own; it ends with this process, however that ends.

    Args:
        command: program and arguments.
        environment: variables on top of this process's own.
        folder: in which it runs; removed by :meth:`close`.

    Raises:
        LinkError: it cannot be started.
    """

    def __init__(self, command: Sequence[str], folder: Path, environment: Mapping[str, str] | None = None) -> None:
        self.folder, self._output = folder, folder / "output.txt"
        try:
            with self._output.open("wb") as output:
                self._process = subprocess.Popen(
                    command, cwd=folder, env={**os.environ, **(environment or {})}, stdin=subprocess.DEVNULL,
                    stdout=output, stderr=subprocess.STDOUT, start_new_session=True, preexec_fn=_end_with_parent,  # noqa: PLW1509
                )  # fmt: skip
        except OSError as error:
            shutil.rmtree(folder, ignore_errors=True)
            raise LinkError(f"{command[0]} does not start: {error.strerror}") from None

    @property
    def running(self) -> bool:
        """True while the process has not ended."""
        return self._process.poll() is None

    @property
    def pid(self) -> int:
        """Number of the process."""
        return self._process.pid

    @property
    def last_words(self) -> str:
        """End of what the program printed, in one line."""
        with contextlib.suppress(OSError):
            text = self._output.read_bytes()[-LAST_WORDS:].decode("utf-8", "replace")
            return " | ".join(line.strip() for line in text.splitlines()[-3:] if line.strip())
        return ""

    def close(self) -> None:
        """Kill the process and all its children, and remove its folder; a second call does nothing."""
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        shutil.rmtree(self.folder, ignore_errors=True)


def make_folder(autopilot: Autopilot) -> Path:
    """New temporary folder for a program to run in."""
    return Path(tempfile.mkdtemp(prefix=f"skyarm_{autopilot.name}_"))


def _end_with_parent() -> None:
    """Have the kernel kill this child process when its parent ends, on Linux."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)
