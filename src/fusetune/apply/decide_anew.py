"""The decision of a folder of results made anew from the scores that are there, by other settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from fusetune.apply.decide import decide
from fusetune.apply.results_folder import ResultsFolder
from fusetune.apply.settings import DecisionSettings
from fusetune.save.present import read_present
from fusetune.set_names import FOUND
from fusetune.storage.documents import read_document
from fusetune.storage.files import AnyPath


def settings_then(results: ResultsFolder) -> dict[str, Any]:
    """The settings that the decision of a run was made by, `seed` among them."""
    rule = results.decision["rule"]
    return {one.name: rule[one.name] for one in fields(DecisionSettings) if one.name in rule}


def decide_anew(results: ResultsFolder, output: AnyPath, settings: DecisionSettings) -> dict[str, Any]:
    """Decide from what a run scored, and write what `decide` writes to another folder.

    The sets are those of the run, and so is what flies now. Its configuration is not read again, so `provenance` names
    no files of it. Of a search the set that was found is decided on as well; it is not searched again.

    Returns
    -------
    What the new `decision.json` holds

    Raises
    ------
    UserError
        A file of the results is missing or damaged.
    """
    then = results.decision
    present = read_present(results.path / "save" / "present.json")
    decide(
        results.analyzed,
        results.flights_table,
        output,
        sets=[one["set"] for one in then["sets"]],
        present=then["present"],
        newest_flight=present.flight,
        same_present=present.same,
        descriptions={one["set"]: one["description"] for one in then["sets"]},
        delays=results.optional("analyze", "delays.json"),
        effects=results.optional("analyze", "effects.json"),
        diagnoses=results.diagnoses(results.replayable),
        legs=results.optional("analyze", "legs.parquet"),
        recommended=_recommended(results, then),
        saved=results.path / "save",
        settings=settings,
    )
    return read_document(Path(output) / "decision.json")


def _recommended(results: ResultsFolder, then: Mapping[str, Any]) -> Any:
    found = results.optional("search", "found.json")
    if found is None or FOUND not in {one["set"] for one in then["sets"]}:
        return None
    # it brings what searches think with
    from fusetune.apply.search.found_sets import read_found_sets

    return read_found_sets(found).recommended
