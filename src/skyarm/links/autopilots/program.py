"""Autopilot program as a child process: find it, start it in its own folder, connect to
it, and always end it.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from itertools import islice
from pathlib import Path

from skyarm.links.autopilots.autopilot import (
    Autopilot,
    LinkError,
    Numbers,
    SimulatorLink,
)
from skyarm.links.transcript import Tape
from skyarm.records.files import shown
from skyarm.scenario.scenario_record import Scenario, ScenarioError, first_state

LAST_WORDS = 400
"""Number of last characters of a program's output that a message repeats."""

MOST_READ = 1 << 16
"""Number of last bytes of a program's output that are read."""


def find_program(autopilot: Autopilot, usual: str = "") -> Path:
    """Path of an autopilot's program: stated, from the environment variable, or
    ``usual`` on the search path.

    Raises:
        ScenarioError: none of them is an executable file.
    """
    stated = autopilot.program or os.environ.get(autopilot.variable, "")
    where = "controller.program" if autopilot.program else autopilot.variable
    if not stated:
        installed = shutil.which(usual) if usual else None
        if installed is None:
            raise ScenarioError(
                f"autopilot: {autopilot.title}'s program is missing; build it"
                " (docs/autopilots.md says how) and set the environment variable"
                f" {autopilot.variable} to its path"
            )
        return Path(installed).absolute()
    path = Path(stated).expanduser().absolute()
    if not path.is_file() or not os.access(path, os.X_OK):
        raise ScenarioError(
            f"{where} = {shown(stated)}: must be an executable file,"
            f" {autopilot.title}'s program"
        )
    return path


GUARD = """exec 3<&0 0</dev/null
folder=$1
shift
{ read -r _ <&3; kill -9 $$; rm -rf -- "$folder"; kill -9 -- -$$; } >/dev/null 2>&1 &
exec "$@" 3<&-
"""
"""Shell command that starts the program next to a guard process of its group, which
waits for the end of a pipe that only this process holds. The kernel closes the pipe
when this process ends, and the guard then ends the program."""


class Child:
    """Child process in its own temporary folder, ended with its parent process even if
    the parent crashes.

    Args:
        command: program and arguments.
        folder: folder in which it runs; removed by :meth:`close`.
        environment: variables on top of this process's own.
        without: beginning of the names of variables of this process that it does not
            get; empty for none.

    Raises:
        LinkError: it cannot be started.
    """

    def __init__(
        self,
        command: Sequence[str],
        folder: Path,
        environment: Mapping[str, str] | None = None,
        without: str = "",
    ) -> None:
        inherited = {
            name: each
            for name, each in os.environ.items()
            if not (without and name.startswith(without))
        }
        self.folder, self._output = folder, folder / "output.txt"
        read_end, self._pipe = os.pipe()
        try:
            with self._output.open("wb") as output:
                self._process = subprocess.Popen(
                    ["/bin/sh", "-c", GUARD, "skyarm", str(folder), *command],
                    cwd=folder,
                    env={**inherited, **(environment or {})},
                    stdin=read_end,
                    stdout=output,
                    stderr=subprocess.STDOUT,
                    # a group of its own, so that the program's children end with it
                    start_new_session=True,
                )
        except OSError as error:
            os.close(self._pipe)
            shutil.rmtree(folder, ignore_errors=True)
            raise LinkError(f"{command[0]} does not start: {error.strerror}") from None
        finally:
            os.close(read_end)

    @property
    def running(self) -> bool:
        """True while the child process has not ended."""
        return self.code is None

    @property
    def code(self) -> int | None:
        """Exit code of the child process, negative if a signal ended it; None while it
        runs.
        """
        return self._process.poll()

    @property
    def pid(self) -> int:
        """Process ID of the child process."""
        return self._process.pid

    @property
    def output(self) -> str:
        """Last ``MOST_READ`` bytes of what the program has printed."""
        with suppress(OSError), self._output.open("rb") as file:
            file.seek(max(file.seek(0, os.SEEK_END) - MOST_READ, 0))
            return file.read(MOST_READ).decode("utf-8", "replace")
        return ""

    @property
    def last_words(self) -> str:
        """Last three different lines that the program printed, without control
        characters.
        """
        lines = filter(None, map(_printable, reversed(self.output.splitlines())))
        words = " | ".join(reversed(list(islice(dict.fromkeys(lines), 3))))
        # the end tells most: the last lines, and of a long one its end
        return words[-LAST_WORDS:]

    def ending(self, title: str) -> str:
        """Last output lines in brackets for an error message, or the exit code of a
        program that printed nothing.
        """
        words, code = self.last_words, self.code
        if words or code is None:
            return f" ({words})" if words else ""
        return f" with code {code} and printed nothing: is it {title}'s program?"

    def end(self) -> None:
        """Kill the process and all its children; a second call does nothing."""
        if self._pipe < 0:
            return
        # a program may have ended by itself
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        os.close(self._pipe)
        self._pipe = -1

    def close(self) -> None:
        """Kill the process and all its children, and remove its folder; a second call
        does nothing.
        """
        self.end()
        shutil.rmtree(self.folder, ignore_errors=True)


def _printable(line: str) -> str:
    """Strip colour codes and control characters from a line of output."""
    # what a program prints may steer a terminal or colour it
    plain = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", line)
    return "".join(c for c in plain if c.isprintable()).strip()


class ProgramLink(SimulatorLink):
    """Connection to a program that it starts itself; closing it ends the process and
    removes folder and sockets.

    Args:
        record: record of the autopilot.
        scenario: scenario with the sensors and the control rate of the link.
        tape: records the exchange, or plays one back in place of the program.
    """

    def __init__(self, record: Autopilot, scenario: Scenario, tape: Tape) -> None:
        self._record, self._title, self._tape = record, record.title, tape
        self._stand = float(first_state(scenario).position.z) - record.climb
        self._rotors = len(scenario.agent.vehicle.rotors)
        self._signals: Numbers = (0.0,) * self._rotors
        self._steps = 0
        self._child: Child | None = None
        self._tcp: socket.socket | None = None
        self._held = ExitStack()

    @contextmanager
    def _starting(self) -> Iterator[None]:
        """Context manager that closes the connection to a program if its start fails.

        Raises:
            LinkError: a port, a file or the program cannot be opened.
        """
        try:
            yield
        except OSError as error:
            self.close()
            raise LinkError(
                f"{self._title} cannot be started: {error.strerror or error}"
            ) from None
        except BaseException:
            self.close()
            raise

    def _make_folder(self) -> Path:
        """Make a temporary folder for the program, which is removed with the link."""
        folder = Path(tempfile.mkdtemp(prefix=f"skyarm_{self._record.name}_"))
        self._held.callback(shutil.rmtree, folder, ignore_errors=True)
        return folder

    def _launch(
        self,
        command: Sequence[str],
        folder: Path,
        environment: Mapping[str, str] | None = None,
        without: str = "",
    ) -> Child:
        """Start the program as a child process; the arguments are those of
        :class:`Child`.
        """
        self._child = Child(command, folder, environment, without)
        self._held.callback(self._child.close)
        return self._child

    def _accept(self, listener: socket.socket) -> socket.socket:
        """Wait for the program's connection to a port.

        Raises:
            LinkError: it ends, or does not connect.
        """
        # a short wait, so that a program that has ended is noticed soon
        listener.settimeout(0.1)
        until = time.monotonic() + self._record.patience
        while True:
            with suppress(TimeoutError):
                connection = self._held.enter_context(listener.accept()[0])
                # small frames go out at once: lockstep waits for each of them
                connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                return connection
            if self._child is None or not self._child.running:
                ending = "" if self._child is None else self._child.ending(self._title)
                raise LinkError(f"{self._title} ended while it started{ending}")
            if time.monotonic() > until:
                port = listener.getsockname()[1]
                raise LinkError(
                    f"{self._title} has not connected to port {port} within"
                    f" {self._record.patience:g} s{self._ending}"
                )

    def _write(self, data: bytes) -> None:
        """Send bytes to the autopilot's program over TCP.

        Raises:
            LinkError: the program reads nothing, or has closed the connection.
        """
        assert self._tcp is not None
        try:
            self._tcp.settimeout(self._record.patience)
            self._tcp.sendall(data)
        except TimeoutError:
            raise LinkError(
                f"{self._title} has read nothing for {self._record.patience:g}"
                f" s{self._ending}"
            ) from None
        except OSError:
            raise self._closing_error() from None

    @property
    def _ending(self) -> str:
        """Last output lines of the program in brackets; empty if there are none."""
        words = self._child.last_words if self._child is not None else ""
        return f" ({words})" if words else ""

    def _closing_error(self) -> LinkError:
        """Error for a connection that the program has closed."""
        return LinkError(f"{self._title} closed the connection{self._ending}")

    def _port_error(self, error: OSError) -> LinkError:
        """Error for a port at which no program listens."""
        return LinkError(
            f"{self._title} is gone: {error.strerror or error}{self._ending}"
        )

    def close(self) -> None:
        """End the program, remove its folder and close the sockets; a second call does
        nothing.
        """
        self._held.close()
