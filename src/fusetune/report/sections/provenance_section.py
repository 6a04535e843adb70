"""Where it all comes from: checksums, settings, files; enough to repeat the decision."""

from fusetune.report.markup import Cell, details, paragraph, section, table
from fusetune.report.results import Results

FILES = {
    "apply/best_params.params": "what to load; rollback.params takes it back; .parm, .sh: for other tools",
    "apply/all_params.params": "every EKF2 parameter as it is to be; all_rollback.params as it is",
    "apply/decision.json": "the decision with all that it rests on",
    "apply/ranking.csv": "the sets with their figures, for a spreadsheet; ranking.parquet holds the same",
    "apply/per_flight.parquet": "score of each set on each flight",
    "apply/sensitivity.json": "what each parameter does",
    "apply/candidates.yaml": "sets that the flights ask for, as a study",
    "apply/fleet.json": "what all flights show together",
    "apply/history.json": "what was decided before, and what it brought",
    "analyze/health.parquet": "a line per figure of health and flight",
    "analyze/<flight>/": "innovations, states, scores, health, diagnosis, effects and sensors of a flight",
    "save/flights.csv": "every log with its verdict; flights.parquet holds the same",
    "report/flights/<flight>.html": "the page of a flight",
}
"""Under `results`: file → what it holds."""


def provenance_section(results: Results) -> str:
    """Checksums, hashes and rules: enough to repeat the decision."""
    decision = results.decision
    logs = [
        (Cell(str(row["flight"])), Cell(str(row["checksum"] or ""), "mono"), str(row["firmware"] or "unknown"))
        for row in decision["flights"]
    ]
    files = [(name, Cell(digest, "mono")) for name, digest in decision["provenance"]["configuration_files"].items()]
    rule = [(str(key), str(value)) for key, value in decision["rule"].items()]
    return section(
        "Where this comes from",
        paragraph(f"Made by {decision['provenance']['product']}."),
        details("Logs and their checksums", table(("log", "SHA-256", "firmware"), logs, kind="whole")),
        details("Configuration files", table(("configuration file", "SHA-256"), files)),
        details("Settings of the decision", table(("setting", "value"), rule)),
        details(
            "Files of results",
            table(("file", "what it holds"), [(Cell(name, "mono"), words) for name, words in FILES.items()]),
        ),
        id="provenance",
    )
