"""Parameter sweeps: many flights of one scenario with varied parameters, their metrics
and statistics.
"""

from skyarm.studies.sweep.runner import SweepSummary, run_sweep
from skyarm.studies.sweep.study import Study, StudyError
from skyarm.studies.sweep.study_file import list_studies, load_study, study_from

__all__ = [
    "Study",
    "StudyError",
    "SweepSummary",
    "list_studies",
    "load_study",
    "run_sweep",
    "study_from",
]
