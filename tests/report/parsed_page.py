"""A page as a list of its elements, for tests: by Python's own parser, which runs no script."""

import json
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

VOID = {"meta", "input", "br", "link", "img"}


@dataclass(eq=False)
class Element:
    """An element with what is inside it and around it."""

    tag: str
    attributes: dict[str, str]
    parent: "Element | None"
    children: "list[Element | str]" = field(default_factory=list)

    @property
    def text(self) -> str:
        return "".join(child if isinstance(child, str) else child.text for child in self.children)

    @property
    def classes(self) -> set[str]:
        return set(self.attributes.get("class", "").split())

    def ancestors(self) -> "list[Element]":
        return [] if self.parent is None else [self.parent, *self.parent.ancestors()]

    def walk(self) -> "list[Element]":
        inside = [child for child in self.children if isinstance(child, Element)]
        return [self, *(element for child in inside for element in child.walk())]

    def all(self, tag: str = "", *, style: str = "", **attributes: str) -> "list[Element]":
        return [
            element
            for element in self.walk()
            if tag in ("", element.tag)
            and (not style or style in element.classes)
            and all(element.attributes.get(name) == value for name, value in attributes.items())
        ]


class _Parser(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.root = self.here = Element("", {}, None)

    def handle_starttag(self, tag, attrs):
        element = Element(tag, {name: value or "" for name, value in attrs}, self.here)
        self.here.children.append(element)
        if tag not in VOID:
            self.here = element

    def handle_startendtag(self, tag, attrs):
        self.here.children.append(Element(tag, {name: value or "" for name, value in attrs}, self.here))

    def handle_endtag(self, tag):
        assert tag == self.here.tag, f"</{tag}> inside <{self.here.tag}>"
        self.here = self.here.parent

    def handle_data(self, data):
        self.here.children.append(data)


def parse(path: Path) -> Element:
    """Parse a page; every element must be closed where it was opened."""
    parser = _Parser()
    parser.feed(path.read_text(encoding="utf-8"))
    assert parser.here is parser.root, f"<{parser.here.tag}> is not closed"
    return parser.root


def metrics(folder: Path) -> Any:
    return json.loads((folder / "metrics.json").read_text(encoding="utf-8"))


def resolve(content: Any, pointer: str) -> Any:
    """What a JSON pointer (RFC 6901) points to."""
    for key in pointer.split("/")[1:]:
        key = key.replace("~1", "/").replace("~0", "~")
        content = content[int(key)] if isinstance(content, list) else content[key]
    return content


def read_number(text: str) -> tuple[float, float]:
    """A number as it is spelled on a page, and half of its last digit."""
    plain = text.replace("−", "-").replace("\u202f", "").strip()
    digits, _, exponent = plain.partition("e")
    decimals = len(digits.partition(".")[2]) - int(exponent or 0)
    return float(plain), 0.5 * 10.0**-decimals
