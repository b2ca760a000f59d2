"""The sampled loop cut open at the commands: its derivatives at an instant, with any dead time of the commands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from skyarm.stability.loop_channels import Channel

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True)
class OpenLoop:
    """Jacobians at an instant; x state (attitude as a rotation vector), u command, m memory, y measurement.

    Attributes:
        period: s. rotors: how many entries of u are rotor speeds; they come first.
        lates: s within a period after which the rotors hear of a new command, ascending from 0; the joints hear of it
            so much later, or earlier in the period, as their delay differs.
        x_x, x_old, x_new: (lates, ...) of the next state by state, acting and new command.
        y_x, y_old: of the measurement now. m_m, m_y, u_m, u_y: of the law, by its memory and the measurement it sees.
        measurement_delay: control periods. command_delay: s, of all commands. rotors_delay, joints_delay: s on top of
            it, of the rotors' and of the joints' part.
        states: how many entries of x are the vehicle's own; those after them are memories of its joint drives. 0: all.
        channels: where it is cut for the margins of single loops; none: each number of a command and a measurement.
    """

    period: float
    rotors: int
    lates: Array
    x_x: Array
    x_old: Array
    x_new: Array
    y_x: Array
    y_old: Array
    m_m: Array
    m_y: Array
    u_m: Array
    u_y: Array
    measurement_delay: int = 0
    command_delay: float = 0.0
    rotors_delay: float = 0.0
    joints_delay: float = 0.0
    states: int = 0
    channels: tuple[Channel, ...] = ()
