"""Sizes and time of an exported controller as the C compiler of this machine builds
it.
"""

from __future__ import annotations

import ctypes
import time
from pathlib import Path

from drawn_inputs import inputs, text_of

import skyarm
from skyarm.control.catalogue import PRESETS, Controller, make_controller, preset
from skyarm.control.model import Model
from support.engines import Loaded, fill, object_file
from support.laws import G


def built(vehicle: str, name: str) -> Controller:
    model = Model(vehicle=skyarm.load_vehicle(vehicle), gravity=G)
    return preset(name, model) if name in PRESETS else make_controller(name, model)


def stack_of(text: str, folder: Path) -> int | None:
    """Largest stack of a function, bytes; None if the compiler does not report it."""
    folder.mkdir()
    try:
        object_file(text, folder, ("-O2", "-fstack-usage"))
    except AssertionError:
        return None
    rows = [line.split() for line in (folder / "program.su").read_text().splitlines()]
    assert {row[-1] for row in rows} == {"static"}
    return max(int(row[-2]) for row in rows)


REPEAT = """
void repeat(int n, const struct law_measurement *m, const struct law_reference *r,
            struct law_memory *k, struct law_command *c);
void repeat(int n, const struct law_measurement *m, const struct law_reference *r,
            struct law_memory *k, struct law_command *c)
{
    struct law_measurement own = *m;
    int i;
    for (i = 0; i < n; ++i) {
        law_step(&own, r, k, c);
        own.position[0] = c->efforts[0] * 1e-3;
    }
}
"""
"""Calls of the law in a row, each with the last one's result."""


def nanoseconds_of(
    controller: Controller, vehicle: str, folder: Path, count: int = 50_000
) -> float:
    """Mean time of a step, ns."""
    in_c = Loaded(text_of(controller) + REPEAT, folder)
    m, r = in_c.kinds["measurement"](), in_c.kinds["reference"]()
    pair = next(inputs(vehicle))
    fill(m, pair[0])
    fill(r, pair[1])
    command = in_c.kinds["command"]()
    start = time.perf_counter()
    in_c.library.repeat(
        count, *(ctypes.byref(each) for each in (m, r, in_c.memory, command))
    )
    return (time.perf_counter() - start) / count * 1e9
