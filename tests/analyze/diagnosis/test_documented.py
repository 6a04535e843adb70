"""docs/diagnosis.md names every cause."""

import re
from pathlib import Path

from fusetune.analyze.diagnosis.causes.registry import CAUSES


def test_the_table_of_causes_is_that_of_the_registry(project_root: Path) -> None:
    text = (project_root / "docs" / "diagnosis.md").read_text(encoding="utf-8")
    table = text.partition("## The causes")[2].partition("## Told apart")[0]
    rows = [row.split("|")[1] for row in table.splitlines() if row.startswith("| `")]
    assert {name for row in rows for name in re.findall(r"`(\w+)`", row)} == set(CAUSES)
