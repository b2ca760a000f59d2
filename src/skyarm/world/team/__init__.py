"""Teams: vehicles whose tips hold one body, and the laws that share its load among them."""

from skyarm.world.team.team import Member, Team, TeamMemory

__all__ = ["Member", "Team", "TeamMemory"]
