"""Pictures of what imports what, as Mermaid draws them, from the imports that the package has.

In a picture stand the folders of one package, and its own files by where they lie among these: those that no folder
imports, those that import none, and those between. Only the imports remain that no chain of others implies. Folders
that import each other stand in one box, with ⇅ between them.
"""

from __future__ import annotations

import ast
from collections import defaultdict
from importlib.util import find_spec
from pathlib import Path

import grimp

Imports = dict[str, set[str]]
"""Name -> names of what it imports."""

MOST_NAMES = 8
"""Of more files than that a box gives the number."""


def pictures(package: str) -> str:
    """A picture of a package, and below it of each of its packages that has folders of its own.

    Returns
    -------
    str
        Markdown, with headings of third rank.
    """
    graph = grimp.build_graph(package, cache_dir=None)
    rooms = [room for room in sorted(graph.find_children(package)) if _folders(graph, room)]
    parts = [_picture(graph, package)]
    parts += [f"### Within {room.removeprefix(f'{package}.')}\n\n{_picture(graph, room)}" for room in rooms]
    return "\n\n".join(parts)


def without_shortcuts(imports: Imports) -> Imports:
    """What remains when an import goes that a chain of others implies (the transitive reduction); circles are refused.

    Raises
    ------
    ValueError
        Names import each other.
    """
    reached = _reached(imports)
    if any(name in reached[name] for name in imports):
        raise ValueError("a circle has no reduction")
    return {
        name: {other for other in others if not any(other in reached[third] for third in others)}
        for name, others in imports.items()
    }


def circles_joined(imports: Imports) -> dict[frozenset[str], set[frozenset[str]]]:
    """The same with one node for all names that import each other."""
    reached = _reached(imports)
    joined = {
        name: frozenset({name} | {other for other in reached[name] if name in reached[other]}) for name in imports
    }
    found: dict[frozenset[str], set[frozenset[str]]] = {group: set() for group in joined.values()}
    for name, others in imports.items():
        found[joined[name]] |= {joined[other] for other in others} - {joined[name]}
    return found


def _reached(imports: Imports) -> Imports:
    """What each name imports directly or by others."""
    reached: Imports = {}
    for name in imports:
        found: set[str] = set()
        new = set(imports[name])
        while new:
            found |= new
            new = {further for other in new for further in imports[other]} - found
        reached[name] = found
    return reached


def _folders(graph: grimp.ImportGraph, package: str) -> set[str]:
    return {child for child in graph.find_children(package) if graph.find_children(child)}


def _picture(graph: grimp.ImportGraph, package: str) -> str:
    joined = circles_joined(_boxes(graph, package))
    groups = {min(group): group for group in joined}
    imports = without_shortcuts({min(group): {min(other) for other in others} for group, others in joined.items()})
    reached = _reached(imports)
    order = sorted(imports, key=lambda box: (-len(reached[box]), box))  # what imports stands above what it imports
    name = {box: _name(box, package, number) for number, box in enumerate(order, 1)}
    lines = ["```mermaid", "flowchart TB"]
    lines += [f'  {name[box]}["{_label(groups[box], package)}"]' for box in order]
    lines += [f"  {name[box]} --> {name[other]}" for box in order for other in order if other in imports[box]]
    return "\n".join([*lines, "```"])


def _boxes(graph: grimp.ImportGraph, package: str) -> Imports:
    """What imports what among the folders of a package and its own files; a box of files has their names, by commas."""
    folders, children = _folders(graph, package), graph.find_children(package)
    owner = {module: child for child in children for module in {child} | graph.find_descendants(child)}
    imports: Imports = {child: set() for child in children}
    for module, child in owner.items():
        imports[child] |= {owner.get(other, child) for other in graph.find_modules_directly_imported_by(module)} - {
            child
        }
    reached = _reached(imports)
    files: dict[object, list[str]] = defaultdict(list)
    for file in sorted(children - folders):
        below, above = reached[file] & folders, frozenset(folder for folder in folders if file in reached[folder])
        # files with the same folders above and below make no circle that is not there
        files["lowest" if not below else "highest" if not above else (frozenset(below), above)].append(file)
    box = {folder: folder for folder in folders}
    box |= {file: ",".join(together) for together in files.values() for file in together}
    found: Imports = {name: set() for name in box.values()}
    for child, others in imports.items():
        found[box[child]] |= {box[other] for other in others} - {box[child]}
    return found


def _is_folder(box: str) -> bool:
    return "," not in box and getattr(find_spec(box), "submodule_search_locations", None) is not None


def _name(box: str, package: str, number: int) -> str:
    """Name of a box in the source of the picture; `end` and the like are words of Mermaid."""
    return f"{box.removeprefix(f'{package}.')}_" if _is_folder(box) else f"files_{number}"


def _label(group: frozenset[str], package: str) -> str:
    """What stands in a box: a folder in bold with what it says of itself, or the names of files."""
    texts = []
    for box in sorted(group):
        names = [name.removeprefix(f"{package}.") for name in box.split(",")]
        if _is_folder(box):
            texts.append(f"<b>{names[0]}</b>{_says(box)}")
        else:
            texts.append(", ".join(names) if len(names) <= MOST_NAMES else f"{len(names)} files")
    return "<br/>⇅<br/>".join(texts)


def _says(folder: str) -> str:
    """The first paragraph of a package's docstring, without its name in front."""
    file = Path(str(getattr(find_spec(folder), "origin", None)))
    paragraph = (ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or "").partition("\n\n")[0]
    said = " ".join(paragraph.split()).replace('"', "'").removesuffix(".")
    name = folder.rpartition(".")[2]
    said = said.removeprefix(f"The {name} room: ").removeprefix(f"The {name}: ")
    return f"<br/>{said}" if said else ""
