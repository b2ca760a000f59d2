"""Positions of servo joints at the instants of a measured flight, by their setpoints, for many candidates at once."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from skyarm.flight_data.series import columns_at
from skyarm.records.arrays import Array
from skyarm.studies.identify.rotor_lag import delay_commands
from skyarm.studies.identify.sampled_series import moving_mean
from skyarm.studies.identify.servo_response import Loops, joint_loads, loops_of, servo_response, servo_steps
from skyarm.vehicle.vehicle_records import Vehicle

if TYPE_CHECKING:
    from skyarm.studies.identify.identified_parts import Surroundings
    from skyarm.studies.identify.motion_model import Stretch


MEMORY = 6
"""Responses, and loads of the joints, that are kept, unless more are asked for at once."""

AT_ONCE = 1e6
"""Numbers of mass matrices that are simulated at once: 8 MB."""


@dataclass(slots=True, eq=False)
class ServoMemo:
    """Positions of the servo joints of one stretch that were computed last."""

    responses: dict[tuple[object, ...], Array] = field(default_factory=dict)
    loads: dict[tuple[object, ...], tuple[Array, Array]] = field(default_factory=dict)
    steps: tuple[int, int, int] | None = None

    def positions(self, vehicle: Vehicle, about: Surroundings, stretch: Stretch, servoed: Sequence[bool]) -> Array:
        """Positions (N + 1, servo joints) by the setpoints."""
        if _response_key(vehicle, about) not in self.responses:
            self.prepare([(vehicle, about)], stretch, servoed)
        return self.responses[_response_key(vehicle, about)]

    def prepare(
        self, candidates: Sequence[tuple[Vehicle, Surroundings]], stretch: Stretch, servoed: Sequence[bool]
    ) -> None:
        """Simulate the servos of several candidates side by side; they are kept until the next ones."""
        joints, step = [i for i, each in enumerate(servoed) if each], stretch.period / stretch.samples
        every = {_response_key(*each): each for each in candidates}
        wanted = {key: each for key, each in every.items() if key not in self.responses}
        if len(self.responses) + len(wanted) > MEMORY:
            self.responses = {key: each for key, each in self.responses.items() if key in every}
        loads = {vehicle.links: self._loads(vehicle, joints, stretch) for vehicle, _ in wanted.values()}
        if self.steps is None and wanted:
            # those of the first candidate: with others a slope by differences would have a jump
            vehicle, _ = next(iter(wanted.values()))
            loops, (inertia, _) = loops_of(vehicle, joints), loads[vehicle.links]
            finer = stretch.fine // stretch.samples
            many, inner = servo_steps(loops.frequency(inertia), stretch.samples, finer, step)
            self.steps = many, inner, math.ceil(loops.memory(inertia) / (many * step))
        left = list(wanted.items())
        size = max(1, int(AT_ONCE / (stretch.size * stretch.samples * len(joints) ** 2)))
        for some in (left[i : i + size] for i in range(0, len(left), size)):
            assert self.steps is not None
            given = [(loops_of(each, joints), about, *loads[each.links]) for _, (each, about) in some]
            rows = _servo_positions(given, stretch, joints, self.steps)
            self.responses |= zip((key for key, _ in some), rows, strict=True)

    def _loads(self, vehicle: Vehicle, joints: Sequence[int], stretch: Stretch) -> tuple[Array, Array]:
        """Mass matrices and loads of the servo joints."""
        if vehicle.links not in self.loads:
            while len(self.loads) >= MEMORY:
                self.loads.pop(next(iter(self.loads)))
            step = stretch.period / stretch.samples
            self.loads[vehicle.links] = joint_loads(vehicle, joints, *stretch.samples_of_motion(), step)
        return self.loads[vehicle.links]


def _response_key(vehicle: Vehicle, about: Surroundings) -> tuple[object, ...]:
    """Numbers on which the response of servos depends."""
    return (about.delay, about.setpoint_hold, vehicle.links, vehicle.drives)


def _servo_positions(
    given: Sequence[tuple[Loops, Surroundings, Array, Array]],
    stretch: Stretch,
    joints: Sequence[int],
    steps: tuple[int, int, int],
) -> list[Array]:
    """Positions (N + 1, servo joints) at the stretch's instants by the setpoints, averaged as the encoders' are.

    Args:
        given: loops, delays, mass matrices and loads of each candidate.
        stretch: setpoints and measured motion.
        joints: numbers of the servo joints.
        steps: samples that are taken together, time steps within them, and those simulated before a part.
    """
    step, turned, (many, inner, before) = (
        stretch.period / stretch.samples,
        stretch.samples_of_motion()[2][:, joints],
        steps,
    )
    times = max(1, many * inner * stretch.samples // stretch.fine)
    commands = np.repeat(stretch.setpoints[:, joints], times, axis=0)
    grid = stretch.period / stretch.fine / times
    goals, inertias, loads = list[Array](), list[Array](), list[Array]()
    for loops, about, inertia, load in given:
        late = [about.delay + float(each.latency) for each in loops.servos]
        heard = np.stack(
            [delay_commands(a[:, None], grid, b)[:, 0] for a, b in zip(commands.T, late, strict=True)], axis=1
        )
        goal = heard.reshape((len(turned) - 1) // many, inner, -1, len(joints)).mean(axis=2)
        goals.append(goal + about.setpoint_hold * (goal.mean(axis=1, keepdims=True) - goal))
        means, pull = (rows.reshape(-1, many, *rows.shape[1:]).mean(axis=1) for rows in (inertia, load))
        # means over a step that are held for a step: both take h^2/24 of the curvature away from what varies in between
        pull[1:-1] -= np.diff(pull, 2, axis=0) / 12.0
        inertias.append(means)
        loads.append(pull)
    begins, rates = turned[:-1:many], np.gradient(turned, step, axis=0)[:-1:many]
    every, at = [loops for loops, *_ in given], np.arange(len(turned))
    known = np.arange(len(begins) + 1) * many
    found = list[Array]()
    for ends in servo_response(
        every, np.stack(goals), np.stack(inertias), np.stack(loads), begins, rates, many * step, before
    ):
        coarse = np.concatenate([turned[:1], ends])
        sampled = columns_at(at, known, coarse)
        found.append(moving_mean(sampled, stretch.width)[:: stretch.samples])
    return found
