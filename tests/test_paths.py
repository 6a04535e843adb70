"""Public functions take paths as text, too."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path


def public_parameters(source: str) -> Iterator[tuple[str, str]]:
    """Names and annotations of the parameters of all public functions and public methods of a module."""
    scopes: list[ast.Module | ast.ClassDef] = [ast.parse(source)]
    while scopes:
        for node in scopes.pop().body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                scopes.append(node)
            if isinstance(node, ast.FunctionDef) and (node.name == "__init__" or not node.name.startswith("_")):
                arguments = node.args
                for argument in (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs):
                    if argument.annotation is not None:
                        yield f"{node.name}({argument.arg})", ast.unparse(argument.annotation)


def takes_only_path_objects(annotation: str) -> bool:
    return re.search(r"\bPath\b", annotation) is not None


def test_what_counts_as_a_path_only() -> None:
    source = """
def f(a: Path, b: str | os.PathLike[str], c: Sequence[Path], d: AnyPath, *, e: Path | None): ...
def _g(a: Path): ...
class _C:
    def __init__(self, a: Path): ...
class D:
    def __init__(self, a: Path): ...
"""
    found = [name for name, annotation in public_parameters(source) if takes_only_path_objects(annotation)]
    assert found == ["f(a)", "f(c)", "f(e)", "__init__(a)"]


def test_every_public_function_takes_text_for_a_path(project_root: Path) -> None:
    offenders = [
        f"{file.relative_to(project_root)}: {name}: {annotation}"
        for file in sorted((project_root / "src").rglob("*.py"))
        for name, annotation in public_parameters(file.read_text(encoding="utf-8"))
        if takes_only_path_objects(annotation)
    ]
    assert offenders == []
