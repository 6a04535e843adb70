"""What a set of the decision stands for where its replays are not of one set: what a search found on all flights.

On each flight the set was replayed with what the search found without that flight, so that the decision sees what the
search is worth on flights that it did not see. What is written is what it found on all of them. How white the sources
are is told by what was found, for the delays of the present set may be wrong.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Recommended:
    """The values that are written.

    Attributes
    ----------
    name : of the set that stands for them
    values : parameters, name → value
    alone : of parameters that it changes, what each brings alone, in words
    objections : what speaks against these very values on the flights that they were found on
    """

    name: str
    values: Mapping[str, float]
    alone: Mapping[str, str] = field(default_factory=dict)
    objections: tuple[str, ...] = ()
