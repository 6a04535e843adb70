# Input and params functions that several rules use; those that ask for verdicts wait for the checkpoint.
import csv
from dataclasses import astuple, replace
from functools import cache

from fusetune.analyze.flight_files import CONFORMANCE_FILE, DELAYS_FILE, DIAGNOSED_FILES, FLIGHT_FILES, TRACK_FILE
from fusetune.analyze.replaying.store.parts import PARTS
from fusetune.apply.parameter_files.names import PARAMETER_FILES
from fusetune.design.covariance.named_files import files_of_design
from fusetune.report.flight_data.shown_limit import MOST_SHOWN_SETS
from fusetune.storage.cells import as_it_was
from fusetune.storage.checksum_file import check_checksum
from fusetune.errors import RUN_AGAIN
from fusetune.set_names import AS_FLOWN, mended_name
from fusetune.storage.documents import read_document
from fusetune.save import read_present
from fusetune.save.discovery import printable
from fusetune.save.flights_sheet import FLIGHTS_SHEET
from fusetune.storage.sheet import table_row

REPLAYED_FILES = [f"results/analyze/{{flight}}/{pset}.{part}" for pset in (PRESENT, AS_FLOWN) for part in PARTS]
"""The replays that are kept of a flight."""

SCORED_FILES = [f"results/analyze/{{flight}}/{name}" for name in FLIGHT_FILES]
"""What the analysis of a flight leaves beside them."""


# `workflow.cores` is an error where jobs run elsewhere and nobody gave a number.
CORES = workflow.resource_settings.cores or 1

MENDS_DELAYS = SETTINGS.delays.mend

TOLD_FILES = [*DIAGNOSED_FILES, TRACK_FILE, CONFORMANCE_FILE, *([DELAYS_FILE] if MENDS_DELAYS else [])]
"""What is told of a flight before any set is compared."""


def read_flights(path):
    """Rows of the table of flights."""
    check_checksum(path, RUN_AGAIN)
    with open(path, encoding="utf-8-sig", newline="") as file:
        cells = [{name: as_it_was(cell) for name, cell in row.items()} for row in csv.DictReader(file)]
    return [table_row(FLIGHTS_SHEET, row) for row in cells]


def replayable_flights():
    rows = read_once(read_flights, checkpoints.list_flights.get().output.csv)
    # What other flights left here is no answer to these; a dry run, which mends nothing, may meet it.
    return [row["flight"] for row in rows if row["status"] == "replayable" and row["flight"] in LOGS]


def of_replayable_flights(patterns):
    """Input function: some files of every flight that can be replayed."""
    return lambda wildcards: expand(patterns, flight=replayable_flights())


def of_a_replayed_flight(file):
    """Input function: a file of the flight of a job, where that is replayed."""

    def files(wildcards):
        when_delays_are_joined(wildcards)
        replayed = wildcards.flight in replayable_flights()
        return f"results/analyze/{wildcards.flight}/{file}" if replayed else []

    return files


@cache
def read_in_state(function, path, state):
    return told_in_one_line(function, path)


def read_once(function, path):
    """What a function reads from a file; read anew only when the file has changed, for every job asks for it."""
    found = os.stat(path) if os.path.exists(path) else None
    return read_in_state(function, path, found and (found.st_mtime_ns, found.st_size, found.st_ino))


def present_found():
    """What flies now and, of a study around it, the sets."""
    return read_once(read_present, checkpoints.list_flights.get().output.present)


def sets_found():
    """All sets: of a study around the present values they are known when the flights are listed."""
    return SETS.found(present_found()) if SETS.around else SETS


def sets_of_analysis(wildcards):
    """Params function: the values of all sets that a flight is replayed with."""
    present = present_found()
    around = {pset.name: pset.overrides for pset in present.sets}
    mended = SETS.mended(SETS.mendable, present.parameters, mended_delays()) if mended_delays() else {}
    return {**SETS.overrides(SETS.replayed, present.parameters), **around, **mended, **effect_overrides(wildcards)}


def when_delays_are_joined(wildcards):
    """Input function, which gives no file, of the job that scores and of all that read scores: Snakemake plans a job anew
    behind a checkpoint, and asks again for its parameters, only where its input waits for that; what reads scores
    would else begin before it is known that they have to be made anew."""
    if MENDS_DELAYS:
        checkpoints.join_delays.get()
    return []


def of_scored_flights(patterns):
    """Input function: some files of every flight's scores, as soon as it is known whether these have to be made anew."""
    return lambda wildcards: when_delays_are_joined(wildcards) or of_replayable_flights(patterns)(wildcards)


def read_joined(path):
    """What all flights tell together; of a checkpoint that was planned and is then not run Snakemake would not say that it
    is done, and begin jobs whose parameters are to be determined."""
    if not os.path.exists(path):
        checkpoints.join_delays.get()
    return read_once(read_document, path)


def mended_delays():
    """Parameters of delays that are proved wrong, with the values to set."""
    if not MENDS_DELAYS:
        return {}
    return read_joined(placed("results/analyze/delays.json"))["mended"]


def effect_values():
    """Sets that take single effects as the flights measure them, with what they change."""
    if not MENDS_DELAYS or not SETTINGS.effects.try_measured:
        return {}
    return read_joined(placed("results/analyze/effects.json"))["sets"]


def effects_are_mended():
    """Whether these have delays mended, too: where any is proved wrong that comes before all else, but a search that
    moves delays finds them itself, and no set beside it has them mended."""
    return bool(mended_delays() and SETS.mendable)


def effect_sets():
    """Names of these."""
    return [mended_name(name) if effects_are_mended() else name for name in effect_values()]


def effect_overrides(wildcards):
    """Params function: what they change."""
    sets = replace(SETS, effects=effect_values())
    present = present_found().parameters
    if effects_are_mended():
        return sets.mended(sets.effects, present, mended_delays())
    return sets.overrides(sets.effects, present)


def mended_sets():
    """Names of the sets with mended delays; none where no delay is proved wrong.

    Of a study around the present values the present set alone is mended: a delay comes before all else, and twice as
    many sets would be harder to tell from chance, and to read.
    """
    return [mended_name(name) for name in SETS.mendable] if mended_delays() else []


def scored_sets(wildcards):
    """Params function: names of all sets that are scored."""
    return [*sets_found().scored, *mended_sets(), *effect_sets()]


def set_descriptions(wildcards):
    """Params function: a line about each set."""
    around = present_found().sets if SETS.around else ()
    sets = replace(sets_found(), effects=effect_values())
    return sets.described({pset.name: pset.description for pset in (*INPUTS.study.sets, *around)})


FLIGHT_BY_FLIGHT = SETTINGS.search_job == "flight"
"""Whether each flight's part of a round of a search is a job of its own."""


def searched_flights_found():
    return read_once(read_document, checkpoints.search_flights.get().output[0])["flights"]


def asked_before(number):
    """What was asked in the rounds before one."""
    return [f"results/search/ask_{each}.json" for each in range(1, number)]


def tried_before(number):
    """Input function: what flights answered in the rounds before one."""
    folders = [f"results/search/tried/{each}" for each in range(1, number)]
    if not FLIGHT_BY_FLIGHT:
        return folders
    return lambda wildcards: [f"{folder}/{flight}.json" for folder in folders for flight in searched_flights_found()]


# What was decided is kept for good, and is no output: nothing of Snakemake's removes it.
HISTORY = placed("results/history")


@cache
def changes_flown():
    """Of every flight that flew a change decided before: which, and the values before and after it."""
    rows = read_once(read_flights, checkpoints.list_flights.get().output.csv)
    if not os.path.isdir(HISTORY):
        return {}
    # it reads saved flights
    from fusetune.apply.history.flown import flights_of_changes

    own = [row for row in rows if row["flight"] in LOGS]
    return told_in_one_line(flights_of_changes, HISTORY, own, placed("results/save"))


def of_flights_after(pattern):
    """Input function: files of the flights that came after a change."""
    return lambda wildcards: expand(pattern, flight=changes_flown())


def verdict_of_flight(wildcards):
    """Labels of a flight in Snakemake's report, from what was found."""
    rows = {row["flight"]: row for row in read_once(read_flights, placed("results/save/flights.csv"))}
    row = rows.get(wildcards.flight, {})
    found = row.get("reason") or f"{row.get('warning_checks', 'no')} warnings"
    return {"flight": wildcards.flight, "verdict": row.get("status", ""), "found": found}


def told_in_report():
    """What Snakemake's report says at its top: of the results that it packs, not of the configuration that is in force."""
    file = placed("results/apply/decision.json")
    if not os.path.exists(file):
        return {}
    document = read_document(file)
    files = document["provenance"]["configuration_files"]
    return {
        "product": document["provenance"]["product"],
        "paragraphs": document["paragraphs"],
        "flights": len(document["flights"]),
        "scored": document["flights_scored"],
        "sets": len(document["sets"]),
        "files": sorted(files),
    }


# around the present values each parameter makes two sets at the most
MOST_SETS = len(SETS.scored) + 2 * len(SETS.around)
SHOWS_SOME_SETS = 2 * MOST_SETS > MOST_SHOWN_SETS
"""Whether a flight's page, with sets whose delays are mended, may show some alone: then it asks for the chosen one."""


def closing_words():
    table, page, decision = map(
        placed, ("results/save/flights.csv", "results/report.html", "results/apply/decision.json")
    )
    if not os.path.exists(table):
        return "Done."
    statuses = [row["status"] for row in told_in_one_line(read_flights, table)]
    kind = "simulated flights" if DEMONSTRATED else "flights"
    refused = len(statuses) - statuses.count("replayable")
    flights = f"{len(statuses)} {kind}, {refused} refused (reasons: {table})."
    changed = [printable(os.path.relpath(name)) for name in CONTENT.changed()]
    if changed:
        flights = f"Changed while the run was at work: {', '.join(changed)}. Run the pipeline again.\n{flights}"
    if not os.path.exists(page):
        return flights
    words = f"{flights} The decision and its evidence: {page}"
    # a run for other targets leaves an older decision as it is, or none
    if os.path.exists(decision):
        for step in read_document(decision).get("next_steps", ())[:1]:
            words += f"\nNext: {step['text']}"
    return words


DESIGNS = {Path(file).stem: file for file in SETTINGS.covariance_designs}
"""Covariance designs: name → file."""


def design_files(wildcards):
    """Input function: the file of a covariance design, and those that it names."""
    return [as_named(file) for file in told_in_one_line(files_of_design, DESIGNS[wildcards.design])]
