"""What `import fusetune as ft` offers to scripts and notebooks: few names, pandas tables, the pipeline's own defaults.

The names of `fusetune.__all__` stand here, each with the object that it gives. What lies below them may change from
release to release; these do not without a word in the changelog.
"""

from fusetune.library.comparison import Comparison, compare
from fusetune.library.decision import Decision, decide
from fusetune.library.diagnosis import DiagnosedFlight, diagnose
from fusetune.library.log import Log, read
from fusetune.library.replay import Replay
from fusetune.library.search import Found, search

__all__ = [
    "Comparison",
    "Decision",
    "DiagnosedFlight",
    "Found",
    "Log",
    "Replay",
    "compare",
    "decide",
    "diagnose",
    "read",
    "search",
]
