"""The last lines of a run: the decision in a sentence, what to load, what to look at, what to do next."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fusetune.apply.decision_summary import DecisionSummary, decision_summary
from fusetune.apply.wording import counted
from fusetune.cli.lines import Lines
from fusetune.storage.documents import read_document
from fusetune.storage.files import AnyPath
from fusetune.storage.parquet import read_table


@dataclass(frozen=True)
class RunOutcome:
    """What a run led to.

    Attributes
    ----------
    results : its folder
    flights, refused : logs, and how many of them cannot be replayed
    is_simulated : whether the flights are those of the demonstration
    decision : None where none was made
    """

    results: Path
    flights: int
    refused: int
    is_simulated: bool
    decision: DecisionSummary | None

    @property
    def page(self) -> Path:
        """The whole story."""
        return self.results / "report.html"

    @property
    def parameter_file(self) -> Path:
        """What to load."""
        return self.results / "apply" / "best_params.params"

    def document(self) -> dict[str, Any]:
        """As JSON holds it."""
        return {
            "flights": self.flights,
            "refused": self.refused,
            "simulated": self.is_simulated,
            **({} if self.decision is None else self.decision.document()),
            "files": {"report": self.page, "parameters": self.parameter_file},
        }

    def lines(self) -> Iterator[str]:
        """For people."""
        kind = "simulated flight" if self.is_simulated else "flight"
        why = f" (why: {self.results / 'save' / 'flights.csv'})" if self.refused else ""
        yield f"{counted(self.flights, kind)}, {self.refused} refused{why}"
        if self.decision is None:
            return
        yield from self.decision.lines()
        if self.decision.can_be_loaded:
            yield f"To load: {self.parameter_file}"
        yield f"Why:     {self.page}"
        if self.decision.next_step:
            yield f"Next:    {self.decision.next_step}"


def run_outcome(results: AnyPath) -> RunOutcome:
    """Read what a run left.

    Raises
    ------
    UserError
        A file is damaged.
    """
    results = Path(results)
    table, decision = results / "save" / "flights.parquet", results / "apply" / "decision.json"
    rows = read_table(table).select(["flight", "status"]).to_pylist() if table.is_file() else []
    return RunOutcome(
        results=results,
        flights=len(rows),
        refused=sum(row["status"] != "replayable" for row in rows),
        # where the demonstration's logs are made
        is_simulated=bool(rows) and all((results / "execute" / f"{row['flight']}.ulg").is_file() for row in rows),
        decision=decision_summary(read_document(decision)) if decision.is_file() else None,
    )


def tell_outcome(outcome: RunOutcome) -> None:
    """Print it."""
    lines = Lines()
    for line in outcome.lines():
        lines.tell_below(line)
