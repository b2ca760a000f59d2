"""Teams: vehicles whose tips hold one body, and the laws that share its load among them."""

from skyarm.world.team.team import Borne, Member, Team, TeamMemory

__all__ = ["Borne", "Member", "Team", "TeamMemory"]
