"""Connection of a control law to an autopilot, over any of the supported protocols."""

from __future__ import annotations

from skyarm.links.outside.dds_link import DdsLink
from skyarm.links.outside.offboard_link import OffboardLink

AutopilotLink = OffboardLink | DdsLink


def open_link(url: str, patience: float = 0.0) -> AutopilotLink:
    """Open the connection to an autopilot at a given address.

    Args:
        url: ``mavlink://HOST:PORT``, ``mavlink-out://HOST:PORT``, ``dds://DOMAIN`` or
            ``dds://DOMAIN/NAMESPACE``.
        patience: s to wait for a port that another program has.

    Raises:
        OffboardError: another form, or a link that cannot be opened.
    """
    return DdsLink(url) if url.startswith("dds:") else OffboardLink(url, patience)
