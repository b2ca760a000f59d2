"""Scenario of a log as pictures need it, without the laws that flew."""

from __future__ import annotations

from typing import Any

from skyarm.control.controller import Controller
from skyarm.control.laws.paper import hybrid_computed_torque
from skyarm.control.model import Model
from skyarm.dynamics.actuators import Mixer
from skyarm.log.flight_log import Log
from skyarm.log.flown_scenario import Info, matches_digest, restore_written
from skyarm.records.immutable import immutable
from skyarm.records.plain import plain
from skyarm.scenario.scenario_record import Scenario


@immutable
class _NoLaw:
    """Constants of a law that no picture needs, in place of those of a user's law."""

    model: Model
    mixer: Mixer


def drawn_scenario(log: Log) -> Scenario:
    """Scenario stored in a log, to be drawn: the law of a plugin that is not loaded is
    left out.

    Raises:
        ValueError: as :attr:`Log.scenario`, such as for other parts of that plugin.
    """
    try:
        scenario: Scenario = log.scenario
    except ValueError:
        drawn = _without_law(log.info)
        if not isinstance(drawn, Scenario):
            raise
        scenario = drawn
    return scenario


def _without_law(info: Info) -> Any:
    """Restore a log's scenario without the constants and functions of its laws; None if
    that fails.
    """
    written: Any = info.get("scenario_record")
    try:
        if not matches_digest(info, written, info.get("code") or {}):
            return None
        agents = written.get("agents") or {"": written["agent"]}
        drawn = {}
        for name, agent in agents.items():
            par = {
                part: restore_written(info, agent["controller"]["par"][part])
                for part in ("model", "mixer")
            }
            # any function of a law would do: what is drawn is not flown
            law = Controller(name="", law=hybrid_computed_torque, par=_NoLaw(**par))
            drawn[name] = agent | {"controller": plain(law)}
        agent = {"agents": drawn} if "agents" in written else {"agent": drawn[""]}
        return restore_written(info, written | agent)
    # of a log that was edited by hand
    except (KeyError, TypeError, AttributeError, ValueError):
        return None
