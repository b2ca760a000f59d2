"""An inertia in three rows must be symmetric, within the rounding of its own digits."""

import pytest

from skyarm.records.coerce import RecordError, inertia

ROWS = [[2.0, 0.1, 0.2], [0.1, 3.0, 0.3], [0.2, 0.3, 4.0]]


def test_three_rows_are_read_as_six_numbers():
    assert [*inertia("inertia", ROWS).entries] == [2.0, 3.0, 4.0, 0.1, 0.2, 0.3]


@pytest.mark.parametrize(("i", "j"), [(0, 1), (2, 0), (1, 2)])
def test_a_row_that_differs_from_its_column_is_refused(i, j):
    rows = [list(row) for row in ROWS]
    rows[i][j] += 0.05
    with pytest.raises(RecordError, match=r"inertia = .*: must be symmetric"):
        inertia("inertia", rows)
