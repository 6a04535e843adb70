"""The named behaviours: all in use, and told in the documentation as they are declared."""

from __future__ import annotations

from dataclasses import fields

from fusetune.ekf2.releases.behaviours import BEHAVIOURS, RELEASES, Behaviours

HEADER = "| behaviour | releases | what it is | in PX4's EKF2 |"


def test_the_table_of_behaviours_is_that_of_the_declarations(project_root, up_to_date):
    rows = []
    for one in fields(Behaviours):
        since, until = one.metadata["since"], one.metadata["until"]
        span = since if since == until else f"{since} … {until}"
        rows.append(f"| `{one.name}` | {span} | {one.metadata['what']} | {one.metadata['source']} |")
    up_to_date(project_root / "docs/releases.md", "behaviours", "\n".join([HEADER, "|---|---|---|---|", *rows]))


def test_every_behaviour_is_asked_for_by_a_kernel(project_root):
    sources = (project_root / "src/fusetune/ekf2").rglob("*.py")
    text = "\n".join(file.read_text(encoding="utf-8") for file in sources if file.name != "behaviours.py")
    assert [one.name for one in fields(Behaviours) if one.name not in text] == []


def test_every_behaviour_has_a_release():
    for one in fields(Behaviours):
        assert any(getattr(BEHAVIOURS[release], one.name) for release in RELEASES)
