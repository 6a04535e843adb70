# Input and params functions that several rules use; those that ask for verdicts wait for the checkpoint.
import csv
from dataclasses import astuple

from fusetune.save import read_present
from fusetune.save.discovery import printable

REPLAY_PARTS = (
    "innovations.parquet",
    "states.parquet",
    "local_position.parquet",
    "status_flags.parquet",
    "withheld.parquet",
    "gaps.parquet",
    "json",
)
REPLAY_SECTIONS = ("withheld", "reconstruction", "start")
SCORE_PARTS = (
    "metrics.parquet",
    "scores.parquet",
    "samples.parquet",
    "withheld.parquet",
    "windows.parquet",
    "scoring.json",
    "onboard.innovations.parquet",
    "fidelity.json",
)


def replay_files(names):
    """Files of the replays of some sets on a flight."""
    return expand("results/analyze/{{flight}}/{pset}.{part}", pset=names, part=REPLAY_PARTS)


def read_csv(path):
    with open(path, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def replayable_flights():
    rows = read_csv(checkpoints.list_flights.get().output.csv)
    # What other flights left here is no answer to these; a dry run, which mends nothing, may meet it.
    return [row["flight"] for row in rows if row["status"] == "replayable" and row["flight"] in LOGS]


def flown_log(flight):
    """Path, name to show and content of a log that was flown; None for a simulated one, which is an input."""
    if DEMONSTRATED:
        return None
    log = FLOWN_LOGS[flight]
    return {"path": log.path, "shown": log.shown, "checksum": CONTENT.of(log.path)}


def of_replayable_flights(patterns):
    """Input function: some files of every flight that can be replayed."""
    return lambda wildcards: expand(patterns, flight=replayable_flights())


def overrides_in(name):
    """Values that a set gives to parameters; as flown means the log's own, without exception."""
    if name == AS_FLOWN:
        return {}
    if name == PRESENT:
        return read_present(checkpoints.list_flights.get().output.present).parameters
    return OVERRIDES[name]


def overrides_of(names):
    """Params function: the values of some sets, so that only sets whose values change are replayed again."""
    return lambda wildcards: {name: overrides_in(name) for name in names}


def closing_words():
    if not os.path.exists("results/save/flights.csv"):
        return "Done."
    statuses = [row["status"] for row in read_csv("results/save/flights.csv")]
    kind = "simulated flights" if DEMONSTRATED else "flights"
    refused = len(statuses) - statuses.count("replayable")
    flights = f"{len(statuses)} {kind}, {refused} refused (reasons: results/save/flights.csv)."
    changed = [printable(os.path.relpath(name)) for name in CONTENT.changed()]
    if changed:
        flights = f"Changed while the run was at work: {', '.join(changed)}. Run the pipeline again.\n{flights}"
    if not os.path.exists("results/report.html"):
        return flights
    return f"{flights} The decision and its evidence: results/report.html"
