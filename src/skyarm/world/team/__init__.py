"""Teams: vehicles whose tips hold one body, and the laws that share its load among them."""

from skyarm.world.team.team import Borne, Member, NothingBorne, Team, TeamMemory

__all__ = ["Borne", "Member", "NothingBorne", "Team", "TeamMemory"]
