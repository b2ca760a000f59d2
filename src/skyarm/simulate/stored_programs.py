"""Programs of flights on disk, beside their machine code, so that a command that is
repeated traces nothing.

A program is found by all that it was traced from: scenario, source files of the
library, versions and processor. Where code of the user's could take part, in the
scenario or by a plugin, nothing is stored.
"""

from __future__ import annotations

import json
import os
import sys
import zlib
from dataclasses import replace

import numpy as np

from skyarm.compile.llvm import object_cache
from skyarm.compile.llvm.kernel import Assembly, compile_behind, processor, work_behind
from skyarm.compile.llvm.shared_steps import cores
from skyarm.compile.tracing.program import Loop
from skyarm.compile.tracing.tracer import Lowered
from skyarm.plant.compiled import Steps
from skyarm.records.files.own_sources import sources_digest, sources_stamp
from skyarm.records.identity import all_files
from skyarm.records.immutable import positional
from skyarm.records.plain import plain
from skyarm.records.restore import restore
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.loop_state import structure_of

ALGEBRA = ("NPY_", "OPENBLAS_", "MKL_", "OMP_", "BLIS_")
"""First letters of the environment variables on which the last bits of NumPy's linear
algebra depend."""


@positional
class FlightProgram:
    """Traced program of a control period as machine code needs it.

    Attributes:
        loop: its operations and scalars are left out where it is stored. assembly: its
            text for LLVM.
        substeps: intervals (s) that it was traced with, each with its number of
            integration steps.
        shared: True if equal vehicles share the code of a period, which compiles sooner
            and flies slower.
    """

    loop: Loop
    assembly: Assembly
    substeps: tuple[tuple[float, Steps], ...]
    shared: bool


def program_name(scenario: Scenario, *details: object) -> str:
    """Text that identifies a flight's program; empty for one that is not stored.

    Args:
        scenario: scenario with concrete numbers.
        *details: whatever else the program depends on.
    """
    stamp = sources_stamp()
    if not stamp or all_files(scenario):
        return ""
    if (sources := object_cache.load(stamp)) is None:  # its files are read once
        sources = sources_digest().encode()
        object_cache.store(stamp, sources)
    content = json.dumps([plain(scenario), details])
    if "<lambda>" in content:  # two of one place have one name
        return ""
    # numbers that NumPy's linear algebra has made are constants of a program
    variables = sorted(
        each for each in os.environ.items() if each[0].startswith(ALGEBRA)
    )
    return "\n".join(
        (
            sources.decode(),
            content,
            sys.version,
            np.__version__,
            processor(),
            f"{cores()} {variables}",
        )
    )


def load_program(name: str) -> FlightProgram | None:
    """Read a stored program by its name; None if there is none."""
    content = object_cache.load(name) if name else None
    program: FlightProgram | None = (
        None if content is None else restore(json.loads(zlib.decompress(content)))
    )
    return program


REPEATS = 30
"""Number of repetitions in which a command may save what full optimisation of its
program takes. Nobody waits for it, and it has the lowest priority: with 10, no flight
of two vehicles that carry a bar was ever optimised."""

_repeated, _fleets = list[str](), list[str]()

APART = (
    "from skyarm.records.files.own_sources import begin_command; begin_command(); "
    "from skyarm.simulate.engine import keep_apart; keep_apart()"
)
"""Python command that stores the program of a fleet whose vehicles share no code."""


def note_repeat(program: FlightProgram, scenario: Scenario) -> None:
    """Note a stored program that is flown again, if one that flies faster pays in the
    end.
    """
    if program.shared:
        _fleets.append(json.dumps(plain(scenario)))
    elif program.assembly.effort == 0 and program.assembly.pays(
        scenario.steps, REPEATS
    ):
        _repeated.append(program.assembly.text)


def optimise_repeated() -> None:
    """Start to compile the programs that this command flew again at full effort, for
    the next time; returns at once.
    """
    for text in _repeated:
        compile_behind(text)
    for flight in _fleets:
        work_behind(APART, flight)


def store_program(name: str, program: FlightProgram) -> None:
    """Store a program under its name, without its operations; an empty name stores
    nothing.
    """
    if name:
        loop = program.loop
        shape = replace(
            # machine code is what flies: the operations would be most of the file
            loop,
            program=Lowered((), (), ()),
            result=((), structure_of(loop.result[1])),
        )
        object_cache.store(
            name,
            # level 1, the fastest, as a command waits for it
            zlib.compress(json.dumps(plain(replace(program, loop=shape))).encode(), 1),
        )
