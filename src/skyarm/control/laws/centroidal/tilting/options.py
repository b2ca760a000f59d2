"""Sideways-force options of the centroidal law, and the constants made from these
options.
"""

from __future__ import annotations

from skyarm.control.controller import ControllerError, LawOptions, OptionRanges
from skyarm.control.laws.centroidal.tilting.sideways_force import SidewaysGains
from skyarm.records.files import shown

OPTIONS: OptionRanges = {
    "sideways": (0.0, 0.0, 1.0),
    "attitude": ((0.0, 0.0), -1.0, 1.0),
}
"""Default value and range of each sideways-force option; the defaults disable sideways
force."""


def sideways_part(gains: LawOptions) -> SidewaysGains | None:
    """Constants of the sideways force from the law's options; None if the law has no
    sideways force.

    Raises:
        ControllerError: an attitude without it.
    """
    attitude = gains["attitude"] if any(gains["attitude"]) else None
    if gains["sideways"]:
        return SidewaysGains(share=gains["sideways"], attitude=attitude)
    if attitude is not None:
        raise ControllerError(
            f"controller.attitude = {shown(attitude)}: must be level without the option"
            " sideways"
        )
    return None
