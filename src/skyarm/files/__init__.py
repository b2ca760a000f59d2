"""Reading tables field by field, and writing files that appear whole or not at all. Knows nothing of flying."""

from skyarm.files.atomic import require_replaceable, require_writable, write_atomically
from skyarm.files.fields import Fields, number, shown

__all__ = ["Fields", "number", "require_replaceable", "require_writable", "shown", "write_atomically"]
