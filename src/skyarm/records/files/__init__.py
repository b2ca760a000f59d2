"""File access: read tables field by field, and write files atomically."""

from skyarm.records.files.fields import (
    Fields,
    filled_list,
    filled_text,
    number,
    three_numbers,
)
from skyarm.records.files.messages import (
    did_you_mean,
    errors_as,
    must_be_one_of,
    nearest,
    one_line,
    printable,
    shown,
)
from skyarm.records.files.names import file_name, require_file, unreadable
from skyarm.records.files.packages import how_to_install, needs_extra, versions
from skyarm.records.files.paths import PathLike
from skyarm.records.files.toml import read_toml, shipped_tables
from skyarm.records.files.writing import (
    file_names,
    output_file,
    require_no_link,
    require_replaceable,
    require_writable,
    sync_folder,
    taken_back,
    write_atomically,
    write_inside,
)

__all__ = [
    "Fields",
    "PathLike",
    "did_you_mean",
    "errors_as",
    "file_name",
    "file_names",
    "filled_list",
    "filled_text",
    "how_to_install",
    "must_be_one_of",
    "nearest",
    "needs_extra",
    "number",
    "one_line",
    "output_file",
    "printable",
    "read_toml",
    "require_file",
    "require_no_link",
    "require_replaceable",
    "require_writable",
    "shipped_tables",
    "shown",
    "sync_folder",
    "taken_back",
    "three_numbers",
    "unreadable",
    "versions",
    "write_atomically",
    "write_inside",
]
