"""README and addresses for the page of a package index: links lead to the repository whose workflow builds the release.

A build elsewhere knows no repository: README stays as it is, and no address is stated.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

LINK = re.compile(r"(?<=\]\()(?!https?:|#)([^)\s]+)(?=\))")
PICTURES = (".gif", ".mp4", ".png", ".svg", ".webp")


def repository(environment: Mapping[str, str]) -> tuple[str, str]:
    """Address of the repository whose workflow builds, and the tag or branch that it builds; both empty elsewhere."""
    server, name = environment.get("GITHUB_SERVER_URL", ""), environment.get("GITHUB_REPOSITORY", "")
    return (f"{server}/{name}", environment.get("GITHUB_REF_NAME", "HEAD")) if server and name else ("", "")


def absolute(text: str, address: str, reference: str) -> str:
    """Markdown whose links to files of the repository lead to it, those of pictures to the files themselves."""

    def lead(found: re.Match[str]) -> str:
        way = "raw" if found[1].partition("#")[0].endswith(PICTURES) else "blob"
        return f"{address}/{way}/{reference}/{found[1]}"

    return LINK.sub(lead, text)


class IndexPage(MetadataHookInterface):
    """README as the text of the index page, and the addresses beside it."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Add text and addresses to the metadata of a build."""
        text = (Path(self.root) / "README.md").read_text("utf-8")
        address, reference = repository(os.environ)
        if address:
            text = absolute(text, address, reference)
            metadata["urls"] = {
                "Repository": address,
                "Documentation": f"{address}/blob/{reference}/docs/README.md",
                "Changelog": f"{address}/blob/{reference}/CHANGELOG.md",
                "Issues": f"{address}/issues",
            }
        metadata["readme"] = {"content-type": "text/markdown", "text": text}
