"""Record of a flight whose control law ran outside the simulator: measurements,
commands and delays.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from skyarm.links.outside.outside_law import OutsideCommand
from skyarm.log.flight_log import Log
from skyarm.records.arrays import Array, doubles
from skyarm.records.leaves import leaves
from skyarm.records.plain import Plain
from skyarm.scenario.scenario_record import Environment, Scenario
from skyarm.sensing.estimate.estimator import PASS_THROUGH
from skyarm.sensing.measurement import Measurement
from skyarm.simulate.assemble_log import AgentPiece, LoggedSamples, log_of_agent
from skyarm.simulate.check_endings import Ended
from skyarm.simulate.inputs import episode_inputs
from skyarm.world import WindSample


def percentiles(seconds: Sequence[float]) -> dict[str, Plain]:
    """Median, 99th percentile and maximum of durations (ms), and their count."""
    if not len(seconds):
        return {"count": 0}
    ms = 1e3 * doubles(seconds)
    statistics = {
        "p50_ms": np.percentile(ms, 50),
        "p99_ms": np.percentile(ms, 99),
        "max_ms": ms.max(),
    }
    return {
        "count": len(ms),
        **{name: round(float(value), 3) for name, value in statistics.items()},
    }


@dataclass(slots=True)
class FlightRecord:
    """Samples of a flight, one for each evaluated control period, and the computing
    times of its set points.

    Attributes:
        first: autopilot's time at the take-over, s.
        ticks: number of the period of each row.
        states: position, quaternion, velocity, rate, joints, joint rates. commands:
            rotor speeds, joint setpoints.
        computing: s from the arrival of a measurement to its set point.
    """

    first: float = 0.0
    ticks: list[int] = field(default_factory=list)
    states: list[tuple[float, ...]] = field(default_factory=list)
    commands: list[tuple[float, ...]] = field(default_factory=list)
    computing: list[float] = field(default_factory=list)

    def add(self, tick: int, seen: Measurement, given: OutsideCommand) -> None:
        """Add the measured state and the command of one control period to the
        record.
        """
        self.ticks.append(tick)
        moving = (
            seen.position,
            seen.quaternion,
            seen.velocity,
            seen.rate,
            seen.joints,
            seen.joint_rates,
        )
        self.states.append(tuple(leaves((*moving, given.law.rotor_speeds))))
        self.commands.append(tuple(leaves(given.law)))

    def log(
        self, scenario: Scenario, ended: Ended | None, facts: Mapping[str, Plain]
    ) -> Log:
        """Convert the record to a flight log; a missed period repeats the sample before
        it, or else the first.

        The states are the autopilot's estimates, the rotor speeds modelled ones.
        """
        count = self.ticks[-1] + 1 if self.ticks else 0
        agent = replace(
            scenario.agent, sensors=(), estimator=PASS_THROUGH, faults=(), payloads=()
        )
        # nothing of a real flight's air, faults and payloads is known to the log
        still = Environment(ground=False)
        plain = replace(
            scenario.with_agent(agent), environment=still, changes=(), endings=()
        )
        rows = np.zeros(count, dtype=int)
        # periods without a sample repeat the newest before them: the maximum so far is
        # its row, as rows are numbered in order
        rows[self.ticks] = np.arange(len(self.ticks))
        rows = np.maximum.accumulate(rows)
        none = np.zeros((count, 0))
        n, rotors, _ = scenario.agent.vehicle.sizes
        flown = LoggedSamples(
            # 13 of the base: position, quaternion, velocity, rate
            states=_table(self.states, 13 + 2 * n + rotors)[rows],
            commands=_table(self.commands, rotors + n)[rows],
            measurement=None,
            readings=(),
            wind=WindSample(),
            found=none,
            led=none,
        )
        piece = AgentPiece(plain, episode_inputs(plain), 0, flown)
        log = log_of_agent(plain, [piece], ended)
        log.info["outside"] = facts
        return log


def _table(rows: Sequence[Sequence[float]], width: int) -> Array:
    return np.array(rows, dtype=float).reshape(len(rows), width)
