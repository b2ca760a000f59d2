"""Log of a flight of several vehicles: a log of each, and what they share."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from skyarm.log.flight_log import Log, rows_of
from skyarm.log.flown_scenario import Info
from skyarm.log.sensor_data import COMPONENTS
from skyarm.log.stored_arrays import ArraysByName
from skyarm.records.arrays import Array
from skyarm.records.immutable import LONGEST
from skyarm.records.members import Members

SHARED = "shared"
"""Key of a description with the names of the arrays of what all vehicles share."""

WITHIN = "/"
"""Character between a vehicle's name and that of its array in a file."""


class OfOneAgentError(AttributeError, ValueError):
    """Error: an array or quantity of one vehicle is read from the log of several."""


class TeamLog(Log):
    """Log of a flight of several vehicles.

    ``log.agents["left"].position`` is the position of one of them. Arrays of what all
    share, such as objects, are attributes of the whole, too (``log.object_position``).
    Whatever reads an array of one vehicle from the whole gets a message of one line
    with the names.

    Attributes:
        time: (N,) s. agents: log of each vehicle by name.
        info: description of the whole flight, as that of a :class:`skyarm.Log`;
            ``info["shared"]`` names the arrays of what all share.
    """

    def __init__(self, agents: Mapping[str, Log], info: Info) -> None:
        self.__dict__.update(
            _agents=Members(tuple(agents), tuple(agents.values())),
            info=info,
            # all vehicles are flown at the same instants
            time=next(iter(agents.values())).time,
        )

    def __repr__(self) -> str:
        said = (
            f"{name}={self.info.get(name)!r}"
            for name in ("scenario", "status", "end_time")
        )
        names, facts = ", ".join(self.agents), ", ".join(said)
        return f"TeamLog({names}: {facts}, instants={self.time.size})"[:LONGEST]

    @property
    def agents(self) -> Mapping[str, Log]:
        """Log of each vehicle by name."""
        agents: Mapping[str, Log] = self.__dict__["_agents"]
        return agents

    @property
    def common(self) -> tuple[str, ...]:
        """Names of the arrays that models logged which all vehicles share."""
        return tuple(self.info.get(SHARED, ()))

    def __getitem__(self, array: str) -> Array:
        """Array by its name: ``left/position`` of one vehicle, or one of what all
        share.
        """
        name, within, own = array.partition(WITHIN)
        if array == "time":
            return self.time
        return (
            self.agents[name][own]
            if within
            else self.component(array.removeprefix(f"{COMPONENTS}."))
        )

    def component(self, name: str) -> Array:
        """Array logged by a model that all vehicles share, such as contact; (N, 0) if
        the flight has no such array.
        """
        first = next(iter(self.agents.values()))
        return (
            first.component(name)
            if name in self.common
            else np.zeros((self.time.size, 0))
        )

    def __getattr__(self, name: str) -> Array:
        """Arrays logged by models that all vehicles share; those of one vehicle are
        refused in one line.
        """
        # private names are asked for by copy and pickle, before there are any agents
        if name.startswith("_"):
            raise AttributeError(name)
        if name not in self.common:
            raise OfOneAgentError(
                f"log.{name}: is of one agent; log.agents[NAME].{name}, of"
                f" {', '.join(self.agents)}"
            )
        return self.component(name)

    def _rows(self, chosen: slice) -> TeamLog:
        return TeamLog(
            {name: rows_of(log, chosen) for name, log in self.agents.items()}, self.info
        )

    def arrays(self) -> Mapping[str, Array]:
        """All arrays by name: ``left/position`` of one vehicle, those of what all share
        without a vehicle's name.
        """
        shared = ["time", *(f"{COMPONENTS}.{name}" for name in self.common)]
        own = (
            f"{name}{WITHIN}{array}"
            for name, log in self.agents.items()
            for array in log.arrays()
        )
        names = [name for name in own if name.partition(WITHIN)[2] not in shared]
        return ArraysByName([*names, *shared], self.__getitem__)
