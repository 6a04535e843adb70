"""The simulated vehicle and the estimator share no physics, so that neither can hide the other's error."""

from __future__ import annotations

import ast
from pathlib import Path


def test_only_the_estimator_aboard_knows_the_estimator(project_root: Path) -> None:
    users = set()
    for file in (project_root / "src/fusetune/execute").glob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            modules = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            modules += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if any(module.startswith("fusetune.ekf2") for module in modules):
                users.add(file.name)
    assert users == {"onboard_estimator.py"}
