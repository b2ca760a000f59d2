"""Log as a table of pandas or of Arrow: the columns of its CSV file, with their
units.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

from skyarm.log.log_columns import FlightArrays, columns
from skyarm.records.files import needs_extra

if TYPE_CHECKING:
    import pandas
    import pyarrow

DataFrame: TypeAlias = "pandas.DataFrame"

ArrowTable: TypeAlias = "pyarrow.Table"


def log_frame(log: FlightArrays) -> DataFrame:
    """Return a log as a pandas DataFrame with the index ``time``; ``attrs["units"]``
    and ``["meanings"]`` by column.

    Raises:
        ValueError: pandas is missing; one line that says how to install it.
    """
    try:
        import pandas as pd
    except ImportError:
        raise ValueError(
            f"pandas: is missing; a log as a DataFrame {needs_extra('pandas')}"
        ) from None
    every = columns(log)
    frame = pd.DataFrame({each.name: each.of(log) for each in every}).set_index("time")
    for name in ("unit", "meaning"):
        frame.attrs[f"{name}s"] = {each.name: getattr(each, name) for each in every}
    return frame


def log_table(log: FlightArrays) -> ArrowTable:
    """Return a log as a pyarrow Table; the metadata of each field are ``unit`` and
    ``meaning``.

    Raises:
        ValueError: pyarrow is missing; one line that says how to install it.
    """
    try:
        import pyarrow as pa
    except ImportError:
        raise ValueError(
            f"pyarrow: is missing; a log as a table {needs_extra('sweep')}"
        ) from None
    every = columns(log)
    arrays = [pa.array(each.of(log)) for each in every]
    fields = [
        pa.field(
            each.name, array.type, metadata={"unit": each.unit, "meaning": each.meaning}
        )
        for each, array in zip(every, arrays, strict=True)
    ]
    return pa.table(arrays, schema=pa.schema(fields))
