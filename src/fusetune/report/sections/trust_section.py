"""How far the replay of each flight can be trusted, in words: the replay of its own parameters against its own log."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fusetune.finding import from_documents
from fusetune.report.markup import Cell, details, number, paragraph, section, table
from fusetune.storage.documents import read_document
from fusetune.storage.files import AnyPath

NOT_COMPARED = "not compared"
GRADE_KINDS = {"A": "good", "B": "good", "C": "", "D": "bad"}
FIGURE_WORDS = {
    "innovation_factor": "size of innovations, replay to vehicle",
    "velocity_m_s": "horizontal velocity, RMS difference, m/s",
    "heading_deg": "heading, RMS difference, °",
    "height_m": "height less its mean, RMS difference, m",
    "vertical_velocity_m_s": "vertical velocity, RMS difference, m/s",
    "height_resets": "resets of height, more or fewer",
    "flags_equal": "flags alike, share of time",
    "height_flags_equal": "height from the same sources, share of time",
}
INTRODUCTION = (
    "Each flight was also replayed with the parameters it flew, and the result set beside what the vehicle's own "
    "estimator logged. The grade follows from the size of the innovations, velocity, heading, height, resets of height "
    "and flags; what the log does not let be compared limits it. A and B repeat the flight, of a C only clear "
    "differences between sets can be trusted. Logs that lack samples are repaired first; how they would stand as they "
    "are is shown beside. A flight of which nothing can be compared has a D, too, but counts in the decision."
)


def read_trust(analyze_folders: Sequence[AnyPath]) -> list[dict[str, Any]]:
    """Documents `fidelity.json` of the flights that were compared."""
    files = [Path(folder) / "fidelity.json" for folder in analyze_folders]
    return [read_document(file) for file in files if file.exists()]


def trust_section(flights: Sequence[dict[str, Any]]) -> str:
    """Table of all flights, and the figures of each behind a click; empty where no flight was compared.

    Parameters
    ----------
    flights : documents `fidelity.json`
    """
    if not flights:
        return ""
    head = ("flight", "grade", "as logged", "in words", "repaired", "what remains")
    parts = [details(f"{flight['flight']}: figures", _details(flight)) for flight in flights]
    rows = [_row(flight) for flight in flights]
    told = details("Grade of each flight", table(head, rows))
    return section(
        "How far the replay can be trusted",
        paragraph(INTRODUCTION),
        told,
        details("Figures of each flight", *parts),
        id="trust",
    )


def _row(flight: dict[str, Any]) -> tuple[str | Cell, ...]:
    trust = flight["trust"]
    repaired = [cause.found for cause in from_documents(trust["causes"]) if cause.evidence["repaired"]]
    return (
        flight["flight"],
        Cell(trust["grade"], GRADE_KINDS[trust["grade"]]),
        Cell(trust["as_logged_grade"], GRADE_KINDS[trust["as_logged_grade"]]),
        trust["words"],
        "; ".join(repaired) or "–",
        trust["reason"] or "–",
    )


def _details(flight: dict[str, Any]) -> str:
    """What the grade follows from, and the innovations sample by sample where the log holds them."""
    parts = [_grade(flight["trust"])]
    if flight["axes"]:
        parts += [
            paragraph(
                f"Sample by sample the innovations differ by {_percent(flight['median_relative_rms'])} (median)."
            ),
            _figures(flight),
        ]
    if flight["reasons"]:
        reasons = "; ".join(reason.in_words for reason in from_documents(flight["reasons"]))
        parts.append(paragraph(f"As logged: {reasons}.", "note"))
    return "".join(parts)


def _percent(value: float | None) -> str:
    return "–" if value is None else f"{value:.0%}"


def _grade(trust: dict[str, Any]) -> str:
    """What the grade follows from: figures of the log as it is and of the replay in use, and what each cause costs."""
    groups = sorted({*trust["as_logged"]["innovation_ratio"], *trust["repaired"]["innovation_ratio"]})
    rows: list[tuple[str | Cell, ...]] = [
        (f"innovations of {group.replace('_', ' ')}, RMS ratio", *_both(trust, "innovation_ratio", group), "–")
        for group in groups
    ]
    rows += [
        (words, *_both(trust, name), trust["figure_grades"].get(name, NOT_COMPARED))
        for name, words in FIGURE_WORDS.items()
        if name != "innovation_factor"
    ]
    causes = [
        (
            cause.found,
            "yes" if cause.evidence["repaired"] else "no",
            number(cause.figure),
            "by switching it" if cause.evidence["measured"] else "what remains",
        )
        for cause in from_documents(trust["causes"])
    ]
    head = (f"grade {trust['grade']} (as logged: {trust['as_logged_grade']})", "as logged", "replay in use", "grade")
    parts = [paragraph(trust["words"]), paragraph(f"Start: {trust['start']}."), table(head, rows)]
    if causes:
        parts.append(table(("cause", "repaired", "cost", "found"), causes))
    return "".join(parts)


def _both(trust: dict[str, Any], name: str, group: str = "") -> tuple[str | Cell, str | Cell]:
    if name == "height_resets":
        first, second = (_most_parted(trust[kind]["resets"]) for kind in ("as_logged", "repaired"))
        return first, second
    values = [trust[kind][name].get(group) if group else trust[kind][name] for kind in ("as_logged", "repaired")]
    first, second = (NOT_COMPARED if value is None else number(value) for value in values)
    return first, second


def _most_parted(resets: dict[str, list[int]]) -> str | Cell:
    """Number of resets, of height or vertical velocity, by which the replay and the vehicle differ most."""
    return number(max(abs(ours - theirs) for ours, theirs in resets.values())) if resets else NOT_COMPARED


def _figures(flight: dict[str, Any]) -> str:
    head = (
        "source", "axis", "samples", "difference / RMS", "RMS ratio", "variance ratio", "fused alike", "rejected alike",
        "NLL difference",
    )  # fmt: skip
    rows = [
        (
            axis["source"],
            str(axis["axis"]),
            str(axis["samples"]),
            _percent(axis["relative_rms"]),
            number(axis["rms_ratio"]),
            number(axis["variance_ratio"]),
            _percent(axis["fused_equal"]),
            _percent(axis["rejected_equal"]),
            number(axis["nll_difference"]),
        )
        for axis in flight["axes"]
    ]
    return table(head, rows)
