"""Reading tables field by field, and writing files that appear whole or not at all. Knows nothing of flying."""

from skyarm.files.atomic import output_file, require_replaceable, require_writable, write_atomically
from skyarm.files.fields import Fields, number, shown
from skyarm.files.read import file_name, unreadable
from skyarm.files.versions import versions

__all__ = [
    "Fields",
    "file_name",
    "number",
    "output_file",
    "require_replaceable",
    "require_writable",
    "shown",
    "unreadable",
    "versions",
    "write_atomically",
]
