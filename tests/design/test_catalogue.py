"""The page about studies says what the catalogue holds."""

from __future__ import annotations

from pathlib import Path

from tests.made_text import UpToDate

from fusetune.design.tunable_parameters import KINDS, TUNABLE_PARAMETERS, USUALLY_VARIED, Kind


def text_of_step(kind: Kind) -> str:
    facts = KINDS[kind]
    unit = {"delay": " ms", "lever arm": " m"}.get(kind, "")
    return f"× {facts.step:g}, ÷ {facts.step:g}" if facts.scale == "log" else f"± {facts.step:g}{unit}"


def kinds_table() -> str:
    rows = [f"| {kind} | {facts.scale} | {text_of_step(kind)} | {facts.why} |" for kind, facts in KINDS.items()]
    return "\n".join(["| kind | scale | step | why |", "|---|---|---|---|", *rows])


def catalogue_table() -> str:
    rows = []
    for name, one in TUNABLE_PARAMETERS.items():
        sources = ", ".join(one.sources) or "–"
        usual = "default" if name in USUALLY_VARIED else ""
        sane = f"{one.low:g} to {one.high:g} {one.unit}".replace("-", "−")
        rows.append(f"| `{name}` | {one.kind} | {sane} | {one.why} | {sources} | {usual} |")
    head = "| parameter | kind | sane range | why it ends there | acts through | |\n|---|---|---|---|---|---|"
    return "\n".join([head, *rows])


def test_the_page_shows_the_catalogue(project_root: Path, up_to_date: UpToDate) -> None:
    page = project_root / "docs" / "studies.md"
    up_to_date(page, "kinds", f"\n{kinds_table()}\n\n")
    up_to_date(page, "catalogue", f"\n{catalogue_table()}\n\n")
