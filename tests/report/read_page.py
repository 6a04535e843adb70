"""A page as a browser reads it: elements, what may act, where links lead."""

from __future__ import annotations

import base64
import hashlib
import re
from dataclasses import dataclass, field
from html.parser import HTMLParser

VOID = {"meta", "br", "hr", "img", "input", "link"}


@dataclass
class Element:
    """A start tag, and the text in it and in what it holds."""

    name: str
    attributes: dict[str, str]
    text: str = ""

    @property
    def classes(self) -> set[str]:
        return set(self.attributes.get("class", "").split())


@dataclass
class Page(HTMLParser):
    """All elements of a page in their order; an element that is not closed, or closed by another, is an error."""

    source: str
    elements: list[Element] = field(default_factory=list)
    _open: list[Element] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__()
        self.feed(self.source)
        assert not self._open, f"not closed: {self._open[-1]}"

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        element = Element(tag, {name: value or "" for name, value in attrs})
        self.elements.append(element)
        if tag not in VOID:
            self._open.append(element)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append(Element(tag, {name: value or "" for name, value in attrs}))

    def handle_endtag(self, tag: str) -> None:
        assert [one.name for one in self._open[-1:]] == [tag], f"</{tag}> closes {self._open[-1:]}"
        self._open.pop()

    def handle_data(self, data: str) -> None:
        for element in self._open:
            element.text += data

    def all(self, name: str, of_class: str = "") -> list[Element]:
        """Elements of a name, and of a class where that is given."""
        return [one for one in self.elements if one.name == name and (not of_class or of_class in one.classes)]

    def with_id(self, id: str) -> Element:
        """The element of an id."""
        (found,) = (one for one in self.elements if one.attributes.get("id") == id)
        return found

    @property
    def links(self) -> list[str]:
        """Where links lead."""
        return [one.attributes["href"] for one in self.all("a")]


def told(html: str) -> str:
    """What a reader sees of HTML."""
    body = html[html.index("<body") :] if "<body" in html else html
    shown = re.sub(r"<(style|script)\b.*?</\1>", " ", body, flags=re.S)
    apart = re.sub(r"</(?:p|li|td|th|dt|dd|h\d|div|text|summary)>", " ", shown)
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", "", apart).replace("&nbsp;", " ").replace("\xa0", " ")).strip()


def check_page(source: str) -> Page:
    """Read a page and see that it keeps the rules of all pages: nothing from outside, nothing inline that acts."""
    page = Page(source)
    (policy,) = (
        one.attributes["content"]
        for one in page.all("meta")
        if one.attributes.get("http-equiv") == "Content-Security-Policy"
    )
    style, script = page.all("style"), [one for one in page.all("script") if "type" not in one.attributes]
    assert (len(style), len(script)) == (1, 1)
    for kind, element in (("style-src", style[0]), ("script-src", script[0])):
        digest = base64.b64encode(hashlib.sha256(element.text.encode()).digest()).decode()
        assert f"{kind} 'sha256-{digest}';" in policy
    assert policy.startswith("default-src 'none';")
    ids = [one.attributes["id"] for one in page.elements if "id" in one.attributes]
    assert len(ids) == len(set(ids)), sorted(one for one in set(ids) if ids.count(one) > 1)
    for one in page.elements:
        acts = [name for name in one.attributes if name == "style" or name.startswith("on")]
        assert not acts, one
        assert one.name not in ("link", "iframe", "object", "embed", "base", "form"), one
        assert one.attributes.get("src", "data:").startswith("data:"), one
        assert one.name != "script" or one.attributes.get("type", "") in ("", "application/octet-stream"), one
        for reference in ("aria-controls", "aria-labelledby", "aria-describedby"):
            assert set(one.attributes.get(reference, "").split()) <= set(ids), one
        if one.name == "dfn":
            assert f"term-{one.attributes['data-term']}" in ids
    for link in page.links:
        assert not re.match(r"\w+:", link), link
        assert not link.startswith("#") or link[1:] in ids, link
    assert not re.search(r"\b(?:nan|None)\b", told(source))
    return page
