"""Reading tables field by field, and writing files that appear whole or not at all. Knows nothing of flying."""

from skyarm.files.atomic import output_file, require_replaceable, require_writable, sync_folder, write_atomically
from skyarm.files.fields import Fields, all_wrong_words, number
from skyarm.files.inside import file_names, require_no_link, write_inside
from skyarm.files.one_line import one_line, printable, shown
from skyarm.files.optional_extras import how_to_install, needs_extra
from skyarm.files.read import file_name, unreadable
from skyarm.files.suggestions import did_you_mean, must_be_one_of, nearest
from skyarm.files.take_back import taken_back
from skyarm.files.toml_text import read_toml
from skyarm.files.versions import versions

__all__ = [
    "Fields",
    "all_wrong_words",
    "did_you_mean",
    "file_name",
    "file_names",
    "how_to_install",
    "must_be_one_of",
    "nearest",
    "needs_extra",
    "number",
    "one_line",
    "output_file",
    "printable",
    "read_toml",
    "require_no_link",
    "require_replaceable",
    "require_writable",
    "shown",
    "sync_folder",
    "taken_back",
    "unreadable",
    "versions",
    "write_atomically",
    "write_inside",
]
