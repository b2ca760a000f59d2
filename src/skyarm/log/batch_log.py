"""The decimated log of a batch: arrays of lanes and samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.actuation import Command
from skyarm.compile import leaves, rebuild
from skyarm.dynamics import State
from skyarm.reference import Reference
from skyarm.scalars import Scalar

Array = npt.NDArray[Any]


@dataclass(frozen=True, kw_only=True, slots=True)
class Logged:
    """What a batch keeps of a control instant; the command is the one issued then, the reference the held one."""

    alive: Scalar
    state: State
    command: Command
    reference: Reference


@dataclass(frozen=True, kw_only=True, slots=True)
class BatchLog:
    """Every k-th control instant of each lane; NaN from the end of an episode on.

    Attributes:
        time: (samples,), s. alive: (lanes, samples), bool.
        state, command, reference: records whose scalars are (lanes, samples); what is structure in them stays so.
    """

    time: Array
    alive: Array
    state: State
    command: Command
    reference: Reference


def batch_log(example: Logged, rows: Array, time: Array) -> BatchLog:
    """Sort what a kernel logged.

    Args:
        example: the record that was logged.
        rows: (samples, leaves, lanes).
        time: (samples,), s.
    """
    columns = np.ascontiguousarray(rows.transpose(1, 2, 0))
    count = len(leaves(example))
    whole: Logged = rebuild(example, iter(columns[:count]))
    alive = np.asarray(whole.alive) > 0.5
    columns[:, ~alive] = np.nan
    return BatchLog(time=time, alive=alive, state=whole.state, command=whole.command, reference=whole.reference)
