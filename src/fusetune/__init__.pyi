from fusetune.errors import UserError as UserError
from fusetune.library import Comparison as Comparison
from fusetune.library import Decision as Decision
from fusetune.library import DiagnosedFlight as DiagnosedFlight
from fusetune.library import Found as Found
from fusetune.library import Log as Log
from fusetune.library import Replay as Replay
from fusetune.library import compare as compare
from fusetune.library import decide as decide
from fusetune.library import diagnose as diagnose
from fusetune.library import read as read
from fusetune.library import search as search

__version__: str
__all__: list[str]
