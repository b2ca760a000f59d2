"""Phases whose end was not seen in time, from the log's own times."""

from types import SimpleNamespace

import numpy as np

from skyarm.log.periods import timed_out


def test_a_phase_is_done_by_its_timeout_where_the_reference_rested_so_long():
    time = 0.1 * np.arange(40)
    waits = [
        {"phase": 0, "at": 1.0, "timeout": 0.5},
        {"phase": 2, "at": 2.0, "timeout": 0.5},
    ]
    for rest, late in ((5, {0}), (4, set())):
        path = np.minimum(np.maximum(time - 0.1 * rest, np.minimum(time, 1.0)), 9.0)
        assert (
            timed_out(SimpleNamespace(time=time, path_time=path, info={"waits": waits}))
            == late
        )
    assert timed_out(SimpleNamespace(time=time, path_time=time, info={})) == set()
