"""What a page says: its words and its numbers, and never the letters of a picture that is embedded in it."""

from __future__ import annotations

import re
from html.parser import HTMLParser

_EMBEDDED = re.compile(r"data:[a-z]+/[a-z0-9.+-]+;base64,[A-Za-z0-9+/=\s]*")


def without_pictures(page: str) -> str:
    """Return the source of a page less its embedded files, whose letters may spell any word.

    >>> without_pictures('<img src="data:image/png;base64,aNaN+/=="> NaN')
    '<img src=""> NaN'
    """
    return _EMBEDDED.sub("", page)


class PageReader(HTMLParser):
    """Collect the visible text and everything that a browser would fetch."""

    def __init__(self) -> None:
        super().__init__()
        self.texts: list[str] = []
        self.fetched: list[str] = []
        self.tags: list[str] = []
        self._in_style = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self._in_style = tag == "style" or (self._in_style and tag != "main")
        self.fetched += [
            value or "" for name, value in attrs if name in ("src", "href", "xlink:href", "data", "action")
        ]

    def handle_endtag(self, tag: str) -> None:
        self._in_style = self._in_style and tag != "style"

    def handle_data(self, data: str) -> None:
        if not self._in_style:
            self.texts.append(data)

    @classmethod
    def of(cls, page: str) -> PageReader:
        reader = cls()
        reader.feed(page)
        return reader

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.texts).split())
