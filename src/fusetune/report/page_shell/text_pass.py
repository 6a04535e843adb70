"""What is done to the words of a page when it is put together: names of flights shortened, terms marked."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Mapping
from html import escape

_TAG = re.compile(r"(<[^>]*>)")
_NAME = re.compile(r"</?([a-zA-Z][a-zA-Z0-9]*)")
_VOID = frozenset(("area", "base", "br", "col", "hr", "img", "input", "link", "meta", "source", "wbr"))
_CLASSES = re.compile(r' class="([^"]*)"')
_PICTURE = re.compile(r"(<svg\b.*?</svg>)", re.DOTALL)
_DRAWN_TEXT = re.compile(r"(<(?:text|tspan)\b[^>]*>)([^<]+)")

_PICTURE_IDS = re.compile(r'aria-labelledby="([\w-]+)-t \1-d">.*?id="\1-t".*?id="\1-d"', re.DOTALL)

Change = Callable[[str], str]


def map_text(html: str, change: Change, *, drawn: Change | None = None, skip: frozenset[str] = frozenset()) -> str:
    """HTML with its text changed, tags and attributes as they were.

    Parameters
    ----------
    html : of our own making, so every `<` in text and attributes is escaped
    change : of the text between tags
    drawn : of the text in pictures, not of what they are called; None leaves it
    skip : elements whose text stays, and classes as `.quiet`
    """
    # the most of a page's tags are those of pictures
    parts = _PICTURE.split(html)
    parts[1::2] = [one if drawn is None else _in_picture(one, drawn) for one in parts[1::2]]
    open_elements: list[tuple[str, bool]] = []
    parts[::2] = [_in_words(one, change, skip, open_elements) for one in parts[::2]]
    return "".join(parts)


def _in_picture(picture: str, change: Change) -> str:
    return _DRAWN_TEXT.sub(lambda match: match[1] + change(match[2]), picture)


def _in_words(html: str, change: Change, skip: frozenset[str], open_elements: list[tuple[str, bool]]) -> str:
    """A piece between pictures; `open_elements` are those that are open where it begins, and after it where it ends,
    each with whether its text stays."""
    parts = _TAG.split(html)
    for place, part in enumerate(parts):
        if place % 2 == 0:
            if part and not (open_elements and open_elements[-1][1]):
                parts[place] = change(part)
            continue
        match = _NAME.match(part)
        name = match[1].lower() if match else ""
        if not name or name in _VOID or part.endswith("/>"):
            continue
        if part[1] == "/":
            while open_elements and open_elements.pop()[0] != name:
                pass
        else:
            stays = bool(open_elements) and open_elements[-1][1]
            open_elements.append((name, stays or _is_skipped(name, part, skip)))
    return "".join(parts)


def _is_skipped(name: str, tag: str, skip: frozenset[str]) -> bool:
    if name in skip or name in ("script", "style"):
        return True
    match = _CLASSES.search(tag) if "class=" in tag else None
    return match is not None and any(f".{one}" in skip for one in match[1].split())


def with_short_names(html: str, names: Mapping[str, str]) -> str:
    """HTML in whose words each flight has its short name, the whole one where the pointer rests.

    Parameters
    ----------
    names : whole → short (`fusetune.report.flight_names.short_names`)
    """
    short = {escape(name): escape(one) for name, one in names.items() if name != one}
    if not short:
        return html
    # the longest first: one name may begin another
    found = re.compile("|".join(re.escape(one) for one in sorted(short, key=len, reverse=True)))

    def written(match: re.Match[str]) -> str:
        return f'<abbr title="{match[0]}">{short[match[0]]}</abbr>'

    return map_text(
        html,
        lambda text: found.sub(written, text),
        drawn=lambda text: found.sub(lambda match: short[match[0]], text),
        skip=frozenset(("code", "pre", ".whole")),
    )


def with_own_ids(html: str) -> str:
    """HTML in which pictures that are alike, and so have the same ids, have ids of their own."""
    seen: Counter[str] = Counter()

    def told(match: re.Match[str]) -> str:
        key = match[1]
        seen[key] += 1
        return match[0] if seen[key] == 1 else match[0].replace(key, f"{key}-{seen[key]}")

    return _PICTURE_IDS.sub(told, html)
