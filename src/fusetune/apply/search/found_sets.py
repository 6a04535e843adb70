"""What a search gives to analysis and decision, and what `search.json` says of both."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from fusetune import __version__
from fusetune.apply.ranking import improvement_percent
from fusetune.apply.recommended import Recommended
from fusetune.apply.rounded import rounded
from fusetune.apply.search.outcome import Outcome
from fusetune.apply.search.result import candidate_documents, gain_percent, parameter_documents, search_documents
from fusetune.apply.search.space import Space
from fusetune.apply.search.words import alone_sentences, search_sentences
from fusetune.apply.settings import DecisionSettings
from fusetune.design.search_settings import SearchSettings
from fusetune.set_names import FOUND, PRESENT
from fusetune.storage.documents import read_as, write_document
from fusetune.storage.files import AnyPath, atomic_path

FEWEST_FLIGHTS = 6
"""With fewer flights what is kept aside shows too little: the decision is called exploratory."""

DESCRIPTION = "what the search found; on each flight, what it found without that flight"


@dataclass(frozen=True)
class FoundSets:
    """The sets of a search.

    Attributes
    ----------
    recommended : what was found on all flights; None where that is nothing new, or no flight could be kept aside
    on_flights : the set that stands for it on each flight, which is what was found without that flight, by parameter;
        empty where nothing is recommended
    document : the part of `search.json` that no decision changes
    """

    recommended: Recommended | None
    on_flights: Mapping[str, Mapping[str, float]]
    document: Mapping[str, Any]

    @property
    def decided(self) -> list[str]:
        """Names of the sets that the decision compares."""
        return [PRESENT, FOUND] if self.on_flights else [PRESENT]


def found_sets(
    outcome: Outcome,
    space: Space,
    search: SearchSettings,
    left_out: Mapping[str, str],
    present_values: Mapping[str, float],
    matters: Sequence[str] = (),
) -> FoundSets:
    """What searches found.

    Parameters
    ----------
    left_out : flights that were not searched on, and why
    present_values : of all that a set of the search may change, as far as the vehicle's log knows them
    matters : what the search tells of the parameters, in words
    """
    found = outcome.found[0]
    objections = tuple(outcome.on_all.objections[0])
    recommended = None
    if found.changed and outcome.aside:
        recommended = Recommended(FOUND, found.values, alone_sentences(found), objections)
    present = space.present
    document = {
        "parameters_found": {
            name: found.values[name] for name in found.values if found.values[name] != present.get(name)
        },
        "parameters_kept": [name for name in space.parameters if name not in found.changed],
        "gain_in_search_percent": gain_percent(outcome.on_all.differences[0].tolist()),
        "gain_kept_aside_percent": gain_percent(list(outcome.aside.values())),
        "kept_aside": {name: gain_percent([value]) for name, value in outcome.aside.items()},
        "spread_of_searches": outcome.spread,
        "objections": list(objections),
        "parameters": parameter_documents(found, space),
        "searches": search_documents(outcome.studied, outcome.found, outcome.on_seen, outcome.aside),
        "flights": list(outcome.studied[0].flights),
        "flights_left_out": dict(left_out),
        "settings": asdict(search),
        "candidates": candidate_documents(outcome.asked),
        "matters": list(matters),
    }
    sets = {name: {**present_values, **values} for name, values in outcome.without.items()}
    return FoundSets(recommended, sets if recommended else {}, document)


def nothing_found(search: SearchSettings, left_out: Mapping[str, str]) -> FoundSets:
    """Where there is no flight to search on."""
    document: dict[str, Any] = {
        "parameters_found": {},
        "parameters_kept": [],
        "gain_in_search_percent": None,
        "gain_kept_aside_percent": None,
        "kept_aside": {},
        "spread_of_searches": 0.0,
        "objections": [],
        "parameters": {},
        "searches": [],
        "flights": [],
        "flights_left_out": dict(left_out),
        "settings": asdict(search),
        "candidates": [],
        "matters": [],
    }
    return FoundSets(None, {}, document)


def search_decision(settings: DecisionSettings) -> DecisionSettings:
    """By what a search is decided: with few flights, what it found is exploratory."""
    return replace(settings, minimum_flights=max(settings.minimum_flights, FEWEST_FLIGHTS))


def write_search_document(file: AnyPath, found: FoundSets, decision: Mapping[str, Any]) -> dict[str, Any]:
    """Write `search.json`, and give what it holds."""
    row = next((one for one in decision["ranking"] if one["name"] == FOUND), None)
    document: dict[str, Any] = {
        "product": f"fusetune {__version__}",
        "status": decision["status"],
        "exploratory": decision["exploratory"],
        "expected_gain": _expected(row, found.document["spread_of_searches"]),
        "paragraphs": [],
        **found.document,
    }
    told = [*search_sentences(document), *document["matters"]] if document["flights"] else []
    document["paragraphs"] = [*decision["paragraphs"], *told]
    written: dict[str, Any] = json.loads(json.dumps(rounded(document)))
    with atomic_path(file) as temporary:
        write_document(temporary, written, allow_nan=False)
    return written


def write_found_sets(file: AnyPath, found: FoundSets) -> None:
    """Write what was found as JSON."""
    with atomic_path(file) as temporary:
        write_document(temporary, asdict(found), allow_nan=False)


def read_found_sets(file: AnyPath) -> FoundSets:
    """Read what `write_found_sets` wrote.

    Raises
    ------
    UserError
        There is none, or it cannot be read.
    """
    return read_as(file, _found_of, "what a search found")


def _found_of(document: dict[str, Any]) -> FoundSets:
    given = document["recommended"]
    recommended = given and Recommended(**given | {"objections": tuple(given["objections"])})
    return FoundSets(recommended, document["on_flights"], document["document"])


SHARED = 1.1
"""Factor on the standard error over the flights kept aside: sets found without different parts share most of their
flights, so no estimate of their mean's error is unbiased (Bengio and Grandvalet 2004). Without it the interval held in
90 % of emulated searches, with it in 93 % (docs/search.md)."""


def _expected(row: Mapping[str, Any] | None, spread: float) -> dict[str, float | None] | None:
    """Gain to be expected on as many flights again, percent, and its interval; None where nothing was kept aside.

    The interval of the decision is one of the mean over all flights to come. The mean over as many flights as were
    searched on varies as much again; and so does by `spread`, nat, what a search finds: the sets that were judged on
    the flights kept aside are not quite the one that is written.
    """
    if row is None or row["difference"] is None:
        return None
    middle, lower, upper = row["difference"], row["lower"], row["upper"]
    if lower is None or upper is None or not row["error"]:
        return {"percent": improvement_percent(middle), "lower_percent": None, "upper_percent": None}
    times = 0.5 * (upper - lower) / row["error"]
    half = times * math.sqrt(2.0 * (SHARED * row["error"]) ** 2 + spread**2)
    ends = improvement_percent(middle + half), improvement_percent(middle - half)
    return {"percent": improvement_percent(middle), "lower_percent": ends[0], "upper_percent": ends[1]}
