"""Parts of the centroidal law changed in its constants or its memory."""

import dataclasses
from typing import Any


def with_parts(record: Any, **changes: Any) -> Any:
    """The constants, or the memory, with other parts."""
    return dataclasses.replace(record, parts=dataclasses.replace(record.parts, **changes))
