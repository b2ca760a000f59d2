"""Machine code of these tests is made in a hurry; its bits are the same."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from shared_programs import hurried

OPTIMISED = ("test_batch", "test_native_loop")
"""Files that fly what the compiler makes when it takes its time."""


@pytest.fixture(autouse=True, scope="module")
def _hurried_code(request: pytest.FixtureRequest) -> Iterator[None]:
    if request.module.__name__ in OPTIMISED:
        yield
        return
    with hurried():
        yield
