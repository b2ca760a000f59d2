"""What holds for every process of the tests, before NumPy is loaded."""

from __future__ import annotations

import os

# one thread of BLAS a process, as the command line sets it: the processes of the tests take every core already, and
# threads that wait for each other there made some tests five times slower
for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
