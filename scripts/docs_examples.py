"""Examples in docstrings as code: mkdocstrings' reader (griffe) knows them only under a heading."""

from typing import Any

import griffe


class Examples(griffe.Extension):
    """Fences the paragraphs that begin with `>>>`."""

    def on_object(self, *, obj: griffe.Object, **_rest: Any) -> None:
        """Change the docstring of an object that was just read."""
        if obj.docstring is not None:
            obj.docstring.value = fenced(obj.docstring.value)


def fenced(text: str) -> str:
    """Paragraphs of a docstring that are doctests, in fences."""
    return "\n\n".join(
        _fence(part) if part.lstrip().startswith(">>>") else part for part in text.split("\n\n")
    )


def _fence(example: str) -> str:
    indent = min(len(line) - len(line.lstrip()) for line in example.splitlines() if line.strip())
    lines = [line[indent:] for line in example.splitlines()]
    return "\n".join(["```pycon", *lines, "```"])
