"""Present instant of a flight under simulation: time, state, readings, and the control
period flown last.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from skyarm.dynamics import State
from skyarm.log.team_log import WITHIN
from skyarm.plant.loads import wind_at
from skyarm.records.arrays import Array
from skyarm.reference import Reference
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.sensing.measurement import Measurement
from skyarm.simulate.assemble_log import Piece, state_arrays
from skyarm.simulate.check_endings import Ended
from skyarm.simulate.engine import Engine
from skyarm.simulate.loop_state import LoopState
from skyarm.simulate.stages import Stages
from skyarm.world import WindSample

if TYPE_CHECKING:
    from skyarm.simulate.eyes import Eyes, RangeImage


class FlightInstant:
    """Present instant of a flight, which reading does not change; a
    :class:`skyarm.Session` moves it on.
    """

    _engine: Engine
    """Simulator of the scenario in force."""

    _seen: tuple[Scenario, Eyes] | None = None
    """Cameras that were asked for last, with their scenario."""

    @property
    def tick(self) -> int:
        """Number of control periods flown so far."""
        return self._engine.tick

    @property
    def time(self) -> float:
        """Time at the start of the next period, s."""
        return self.tick / self._engine.scenario.rates.control

    @property
    def ended(self) -> Ended | None:
        """Status, cause and time of an early end of the flight, or None."""
        return self._engine.ended

    @property
    def running(self) -> bool:
        """True if another period can be flown."""
        return self.ended is None and self.tick < self._engine.scenario.steps

    @property
    def state(self) -> State:
        """True current state of the plant, without sensor errors."""
        self._require_one("state")
        return self._engine.state()

    @property
    def now(self) -> LoopState:
        """Closed-loop state before the next period, or at the end: plant, commands and
        readings, internal states.
        """
        return self._engine.now

    @property
    def measurement(self) -> Measurement:
        """Measurement that the control law receives in the next period."""
        self._require_one("measurement")
        self._require_running()
        (only,) = self._engine.measurements()
        return only

    @property
    def wind(self) -> WindSample:
        """Air velocity (m/s) and wind force (N) on the base at the start of the next
        control period, world axes.
        """
        self._require_one("wind")
        (only,) = Stages(self._engine.scenario).around(self.now, self.time)
        return wind_at(*only)

    @property
    def reference(self) -> Reference:
        """Reference sample that is held in the next control period."""
        self._require_one("reference")
        self._require_running()
        return self._engine.reference()

    def frame(self, sensor: str) -> RangeImage:
        """Picture of a camera or lidar from the present state.

        Args:
            sensor: name of the sensor, as ``wrist``, or ``left.wrist`` of several
                vehicles.

        Raises:
            ScenarioError: no such sensor.
        """
        return self._eyes.frame(sensor, self.now, self.time, self.tick)

    def is_due(self, sensor: str) -> bool:
        """True if a camera or lidar takes a picture in the next period."""
        return self._eyes.is_due(sensor, self.tick)

    @property
    def _eyes(self) -> Eyes:
        """Cameras and lidars of the scenario in force."""
        # most flights have none: neither module nor shapes are loaded for these
        from skyarm.simulate.eyes import Eyes

        scenario = self._engine.scenario
        if self._seen is None or self._seen[0] is not scenario:
            self._seen = scenario, Eyes(scenario)
        return self._seen[1]

    @property
    def latest(self) -> Piece:
        """Logged samples of the control period that was flown last; none right after a
        change of the scenario.
        """
        engine = self._engine
        start = max(engine.tick - 1, engine.begun)
        return Piece(
            engine.scenario,
            engine.inputs,
            start,
            engine.recorder.samples(start, engine.tick),
        )

    @property
    def latest_arrays(self) -> dict[str, Array]:
        """Time, state and commands of the last control period by their names in a log;
        faster than :attr:`latest`.
        """
        engine = self._engine
        arrays = dict[str, Array]()
        start = max(engine.tick - 1, engine.begun)
        times = engine.inputs.times[start : engine.tick]
        agents = engine.scenario.agents
        rows = zip(
            agents.items(),
            engine.recorder.states_and_commands(start, engine.tick),
            strict=True,
        )
        for (name, agent), (states, commands) in rows:
            # a log names the arrays of an only vehicle without its name (team_log)
            own = state_arrays(agent.vehicle, times, states, commands)
            arrays |= (
                own
                if len(agents) == 1
                else {f"{name}{WITHIN}{array}": each for array, each in own.items()}
            )
        return {**arrays, "time": times}

    def _require_one(self, word: str) -> None:
        """Raise an error about what is of one vehicle if the session flies several."""
        agents = self._engine.scenario.agents
        # session.state and its like are of an only vehicle, in files and scripts alike
        if len(agents) > 1:
            raise ScenarioError(
                f"session.{word}: is of one agent; session.now.agents is of"
                f" {', '.join(agents)}"
            )

    def _require_running(self) -> None:
        if not self.running:
            raise ScenarioError("session: has ended; there is no next period")
