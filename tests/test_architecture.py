from __future__ import annotations

import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.import_picture import Imports, circles_joined, pictures, without_shortcuts
from tests.made_text import UpToDate


def test_the_pictures_of_what_imports_what_show_the_imports(project_root: Path, up_to_date: UpToDate) -> None:
    up_to_date(project_root / "docs" / "architecture.md", "imports", f"\n{pictures('fusetune')}\n\n")


def test_an_import_that_a_chain_of_others_implies_is_left_out() -> None:
    assert without_shortcuts({"a": {"b", "c", "d"}, "b": {"c"}, "c": set(), "d": {"c"}}) == {
        "a": {"b", "d"},
        "b": {"c"},
        "c": set(),
        "d": {"c"},
    }


def test_of_names_that_import_each_other_one_is_made() -> None:
    circle, other = frozenset("ab"), frozenset("c")
    assert circles_joined({"a": {"b"}, "b": {"a", "c"}, "c": set()}) == {circle: {other}, other: set()}
    with pytest.raises(ValueError, match="circle"):
        without_shortcuts({"a": {"b"}, "b": {"a"}})


@given(st.sets(st.tuples(st.integers(0, 7), st.integers(0, 7))))
def test_what_remains_leads_as_far_and_nothing_of_it_can_be_spared(pairs: set[tuple[int, int]]) -> None:
    """The two properties that define a transitive reduction (Aho, Garey and Ullman, 1972)."""
    imports: Imports = {str(name): {str(low) for high, low in pairs if high == name > low} for name in range(8)}
    reduced = without_shortcuts(imports)
    assert closure(reduced) == closure(imports)
    for name, others in reduced.items():
        for other in others:
            assert closure({**reduced, name: others - {other}}) != closure(imports)


def closure(imports: Imports) -> set[tuple[str, str]]:
    """By Warshall's algorithm, which the code under test does not use."""
    found = {(high, low) for high, others in imports.items() for low in others}
    for middle in imports:
        found |= {(high, low) for high, before in found if before == middle for after, low in found if after == middle}
    return found


def test_a_picture_has_folders_with_what_they_say_and_files_by_where_they_lie(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = "house_in_a_picture"
    sources = {
        "__init__.py": "",
        "command.py": f"import {package}.roof.tiles",
        "mortar.py": "",
        "roof/__init__.py": '"""The roof: keeps the "rain" out.\n\nAnd more.\n"""',
        "roof/tiles.py": f"from {package}.walls import brick, plaster\nimport {package}.mortar",
        "walls/__init__.py": "",
        "walls/brick.py": f"import {package}.mortar, {package}.doors.frame",
        "walls/plaster.py": "",
        "doors/__init__.py": "",
        "doors/frame.py": f"import {package}.walls.plaster",
    }
    for name, text in sources.items():
        file = tmp_path / package / name
        file.parent.mkdir(exist_ok=True, parents=True)
        file.write_text(text, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    picture = pictures(package)
    for module in [name for name in sys.modules if name.startswith(package)]:
        monkeypatch.delitem(sys.modules, module)
    assert picture == (
        "```mermaid\n"
        "flowchart TB\n"
        '  files_1["command"]\n'
        "  roof_[\"<b>roof</b><br/>keeps the 'rain' out\"]\n"
        '  doors_["<b>doors</b><br/>⇅<br/><b>walls</b>"]\n'
        '  files_4["mortar"]\n'
        "  files_1 --> roof_\n"
        "  roof_ --> doors_\n"
        "  doors_ --> files_4\n"
        "```"
    )
