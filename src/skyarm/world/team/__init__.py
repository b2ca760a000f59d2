"""Teams: vehicles whose tips hold one body, and the laws that share its load among
them.
"""

from skyarm.world.team.team import Borne, NothingBorne, Team, TeamMemory
from skyarm.world.team.virtual_masses import Member

__all__ = ["Borne", "Member", "NothingBorne", "Team", "TeamMemory"]
