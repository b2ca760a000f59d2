"""Log of a flight of several vehicles: a log of each, and what they share."""

from __future__ import annotations

from collections.abc import Mapping

from skyarm.log.flight_log import Log
from skyarm.log.flown_scenario import Info
from skyarm.records.arrays import Array
from skyarm.records.immutable import LONGEST

WITHIN = "/"
"""Character between a vehicle's name and that of its array in a file."""


class OfOneAgentError(AttributeError, ValueError):
    """Error: an array or quantity of one vehicle is read from the log of several."""


class TeamLog(Log):
    """Log of a flight of several vehicles.

    ``log.agents["left"].position`` is the position of one of them. Arrays of what all share, such as objects, are
    attributes of the whole, too (``log.object_position``). Whatever reads an array of one vehicle from the whole gets a
    message of one line with the names.

    Attributes:
        agents: log of each vehicle by name. info: description of the whole flight, as :attr:`Log.info`; those of the
            vehicles are in ``info["agents"]`` of a file.
    """

    def __init__(self, agents: Mapping[str, Log], info: Info) -> None:
        object.__setattr__(self, "_agents", dict(agents))
        object.__setattr__(self, "info", info)
        object.__setattr__(self, "time", next(iter(agents.values())).time)

    def __repr__(self) -> str:
        said = (f"{name}={self.info.get(name)!r}" for name in ("scenario", "status", "end_time"))
        return f"TeamLog({', '.join(self.agents)}: {', '.join(said)}, instants={self.time.size})"[:LONGEST]

    @property
    def agents(self) -> Mapping[str, Log]:
        """Log of each vehicle by name."""
        agents: Mapping[str, Log] = self.__dict__["_agents"]
        return agents

    def component(self, name: str) -> Array:
        """Array logged by a model that all vehicles share, such as contact; (N, 0) if the flight has no such array."""
        return next(iter(self.agents.values())).component(name)

    def __getattr__(self, name: str) -> Array:
        """Arrays logged by models that all vehicles share; those of one vehicle are refused in one line."""
        if name.startswith("_"):
            raise AttributeError(name)
        agents: Mapping[str, Log] = self.__dict__.get("_agents", {})
        array = next(iter(agents.values())).component(name) if agents else None
        if array is None or not array.size:
            raise OfOneAgentError(f"log.{name}: is of one agent; log.agents[NAME].{name}, of {', '.join(agents)}")
        return array

    def arrays(self) -> dict[str, Array]:
        """All arrays of all vehicles, by name of vehicle and array: ``left/position``."""
        return {
            f"{name}{WITHIN}{array}": values
            for name, log in self.agents.items()
            for array, values in log.arrays().items()
        }
