"""Static data in Rust source as Python values: structs as dicts, slices as lists, `a..=b` as ranges."""

import re
from collections.abc import Iterator
from typing import Any

_TOKEN = re.compile(
    r'\s*(?:"((?:[^"\\]|\\.)*)"|([A-Za-z_]\w*(?:::\w+)*)|(0x[0-9a-fA-F_]+|[0-9_]+)|(\.\.=|[&{}\[\](),:]))'
)
# An escaped character, and a line continued on the next.
_ESCAPE = re.compile(r"\\(?:\n\s*|(.))", re.DOTALL)


def statics(text: str) -> dict[str, Any]:
    """Every `static NAME: TYPE = VALUE;` of a file, by name."""
    found = re.finditer(r"static (\w+): [^=]*= ", text)
    return {match[1]: _Reader(text, match.end()).value() for match in found}


class _Reader:
    """Reads one value and stops behind it."""

    def __init__(self, text: str, at: int) -> None:
        self._tokens = self._split(text, at)
        self._next = next(self._tokens)

    @staticmethod
    def _split(text: str, at: int) -> Iterator[tuple[str, str]]:
        while match := _TOKEN.match(text, at):
            at = match.end()
            string, word, number, mark = match.groups()
            if string is not None:
                yield (
                    "string",
                    _ESCAPE.sub(lambda m: {"n": "\n", "t": "\t"}.get(m[1] or "", m[1] or ""), string),
                )
            elif word is not None:
                yield "word", word
            elif number is not None:
                yield "number", number
            else:
                yield "mark", mark
        yield "end", ""

    def _take(self) -> tuple[str, str]:
        token, self._next = self._next, next(self._tokens, ("end", ""))
        return token

    def value(self) -> Any:
        kind, text = self._take()
        if (kind, text) == ("mark", "&"):
            return self.value()
        if (kind, text) == ("mark", "["):
            return self._list("]")
        if kind == "string":
            return text
        if kind == "number":
            return self._range(int(text.replace("_", ""), 0))
        if kind != "word":
            raise ValueError(f"no value begins with {text!r}")
        if self._next == ("mark", "{"):
            self._take()
            return self._struct()
        if self._next == ("mark", "("):
            self._take()
            inner = self._list(")")
            return inner[0] if len(inner) == 1 else inner
        return None if text == "None" else text

    def _range(self, first: int) -> Any:
        """A number, or the numbers of `first..=last`."""
        if self._next != ("mark", "..="):
            return first
        self._take()
        return range(first, self.value() + 1)

    def _list(self, end: str) -> list[Any]:
        items = []
        while self._next != ("mark", end):
            items.append(self.value())
            if self._next == ("mark", ","):
                self._take()
        self._take()
        return items

    def _struct(self) -> dict[str, Any]:
        members = {}
        while self._next != ("mark", "}"):
            _, name = self._take()
            self._take()
            members[name] = self.value()
            if self._next == ("mark", ","):
                self._take()
        self._take()
        return members
