"""What a stranger adds beside the examples: an ending, a motion, a command."""

from __future__ import annotations

from dataclasses import dataclass

import skyarm


@skyarm.register.ending("ceiling")
@dataclass(frozen=True, kw_only=True)
class Ceiling(skyarm.Ending):
    """The base above a height."""

    height: float
    status = "ceiling"

    def fine(self, scenario, state, goal, slack):
        return state.position.z <= self.height - slack

    def cause(self, scenario, state, goal):
        return f"base above {self.height:g} m"


@skyarm.register.motion("sway", title="to and fro along x")
def sway(*, width: float, period: float, height: float = 1.0) -> skyarm.Trajectory:
    """A sine along x."""
    return skyarm.Trajectory(
        x=skyarm.Sine(amplitude=width, frequency_hz=1.0 / period),
        z=skyarm.Constant(height),
        joints=(),
    )


@skyarm.register.command("greet", title="say hello to someone")
def greet(name: str = "sky") -> None:
    """Say hello to someone."""
    print(f"hello {name}")
