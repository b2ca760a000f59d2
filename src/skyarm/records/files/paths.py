"""Type of a path."""

from __future__ import annotations

import os

PathLike = str | os.PathLike[str]
"""Path of a file or folder, as text or as an object that has one."""
