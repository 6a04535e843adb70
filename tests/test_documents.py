"""What README, CONTRIBUTING and the pages of `docs` name is there: files, folders, modules, links."""

from __future__ import annotations

import re
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest

DOCUMENTS = (
    "README.md", "CONTRIBUTING.md", "CHANGELOG.md", "config/README.md", "flights/README.md", "docs/*.md",
    "docs/howto/*.md",
)  # fmt: skip

MADE = (
    "results", "uploads", ".snakemake", ".cache", ".venv", "flights/*", "flights.csv", "checks.csv", "ranking.csv",
    "candidates.yaml", "apply/candidates.yaml", "save/checks.csv",
)  # fmt: skip
"""What runs and people make."""

OF_PX4 = ("EKF", "src/modules", "Tools")
"""Where PX4 has its files."""

SUFFIXES = {".fish", ".py", ".smk", ".md", ".yaml", ".yml", ".csv", ".toml", ".lock", ".cff", ".css", ".rst"}
RESULTS = {".json", ".parquet", ".params", ".plan", ".png", ".svg", ".ulg", ".html"}
"""Suffixes of what runs write; the repository has none of these but where its full path is given."""


@pytest.fixture(scope="module")
def documents(project_root: Path) -> dict[Path, str]:
    files = {file for pattern in DOCUMENTS for file in project_root.glob(pattern)}
    return {file: file.read_text(encoding="utf-8") for file in files}


def ticked(text: str) -> list[str]:
    """Texts between back-ticks, without blocks of code."""
    return re.findall(r"(?<!`)`([^`\n]+)`(?!`)", re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE))


def is_of_the_tree(text: str) -> bool:
    """Whether a text between back-ticks names something that the repository holds."""
    if not re.fullmatch(r"[\w./*-]+", text) or text.startswith("/"):
        return False
    if any(text == name or text.startswith(f"{name.rstrip('*')}/") for name in (*MADE, *OF_PX4)):
        return False
    suffix = Path(text).suffix
    if suffix in RESULTS or text.isupper():
        return text.startswith(("tests/", "docs/"))
    return "/" in text or suffix in SUFFIXES


def is_there(root: Path, text: str) -> bool:
    """Whether it is a file or folder of the repository, or of the package; a bare name may stand anywhere."""
    text = text.rstrip("/")
    if any(any(base.glob(text)) for base in (root, root / "src" / "fusetune", root / "src" / "fusetune" / "ekf2")):
        return True
    return "/" not in text and any(any((root / part).rglob(text)) for part in ("src", "workflow", "tests", "config"))


def test_every_path_that_is_named_exists(project_root: Path, documents: dict[Path, str]) -> None:
    named = {(file.name, text) for file, content in documents.items() for text in ticked(content)}
    paths = {(name, text) for name, text in named if is_of_the_tree(text)}
    assert len(paths) > 100
    assert sorted((name, text) for name, text in paths if not is_there(project_root, text)) == []


def test_every_module_that_is_named_exists_with_what_is_named_in_it(documents: dict[Path, str]) -> None:
    named = {
        (file.name, text)
        for file, content in documents.items()
        for text in re.findall(r"\b((?:fusetune|benchmarks)(?:\.\w+)+)", content)
        if Path(text).suffix not in SUFFIXES
    }
    assert named
    assert sorted((name, text) for name, text in named if not can_be_imported(text)) == []


def can_be_imported(name: str) -> bool:
    above, _, last = name.rpartition(".")
    try:
        return find_spec(name) is not None or hasattr(import_module(above), last)
    except ModuleNotFoundError:
        return "." in above and hasattr(import_module(above.rpartition(".")[0]), above.rpartition(".")[2])


def test_every_link_within_the_repository_leads_somewhere(documents: dict[Path, str]) -> None:
    links = [
        (file, link)
        for file, content in documents.items()
        for link in re.findall(r"\]\(([^)\s]+)\)", content)
        if not link.startswith("http")
    ]
    assert len(links) > 20
    broken = []
    for file, link in links:
        path, _, heading = link.partition("#")
        target = file.parent / path if path else file
        if not target.exists() or (heading and heading not in headings(target)):
            broken.append((file.name, link))
    assert broken == []


def headings(file: Path) -> set[str]:
    """Anchors of a page, as GitHub makes them."""
    lines = re.findall(r"^#+ (.*)$", file.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", line.lower()).replace(" ", "-") for line in lines}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("save/present.py", True),
        ("docs/nothing.md", True),
        ("present.py", True),
        ("results/report.html", False),
        ("flights/", True),
        ("flights/log001.ulg", False),
        ("FLIGHT/", False),
        ("EKF/common.h", False),
        ("decision.json", False),
        ("EKF2_GPS_V_NOISE", False),
        ("pytest <test> --update", False),
    ],
)
def test_what_counts_as_a_path(text: str, expected: bool) -> None:
    assert is_of_the_tree(text) is expected


def test_a_path_that_is_not_there_is_found_out(project_root: Path) -> None:
    assert is_there(project_root, "save/present.py")
    assert is_there(project_root, "test_registry.py")
    assert not is_there(project_root, "save/absent.py")
    assert not is_there(project_root, "absent.py")
