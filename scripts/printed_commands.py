"""The commands that a page of documentation prints, and what it says that they print.

A fenced block of `sh` after a line `<!-- runs: KIND -->` holds commands of one kind: `quick`, `slow`, `board`
(needs one, or the simulator's) or `measured` (needs measured data). A block of `text` right after it is their
output, with `...` for what was left out.
"""

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

_STEP = re.compile(r"<!-- runs: (\w+) -->\n```sh\n(.*?)```(?:\n```text\n(.*?)```)?", re.DOTALL)
_NUMBER = re.compile(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?")
_BORDERS = re.compile("[^\x20-\x7e±]")
_TOLERANCE = 0.05
_TOLERANCE_OF_INTERVAL = 0.3  # the noise of one recording is not that of another


@dataclass(frozen=True)
class Step:
    """Commands that belong together, and the lines shown as their output."""

    kind: str
    commands: tuple[tuple[str, ...], ...]
    shown: tuple[str, ...]


def steps(page: Path) -> list[Step]:
    """The steps of a page, in its order."""
    return [
        Step(
            found[1],
            tuple(tuple(shlex.split(line, comments=True)) for line in found[2].splitlines() if line.strip()),
            tuple(line for line in (found[3] or "").splitlines() if line.strip()),
        )
        for found in _STEP.finditer(page.read_text(encoding="utf-8"))
    ]


def missing(shown: tuple[str, ...], printed: str) -> list[str]:
    """Lines shown that were not printed: words in the same order, numbers to 5 %, half widths to 30 %.

    Borders of tables do not count.
    """
    words = _BORDERS.sub(" ", printed).split()
    return [line for line in shown if not _occurs(line, words)]


def _occurs(line: str, words: list[str]) -> bool:
    """The parts of a line between `...` occur one after the other, each as neighbouring words."""
    start = 0
    for part in line.split("..."):
        wanted = part.split()
        bounds = [_TOLERANCE_OF_INTERVAL if before == "+-" else _TOLERANCE for before in ["", *wanted]]
        places = range(start, len(words) - len(wanted) + 1)
        found = next((at for at in places if all(map(_alike, wanted, words[at:], bounds))), None)
        if found is None:
            return False
        start = found + len(wanted)
    return True


def _alike(wanted: str, word: str, tolerance: float) -> bool:
    numbers = _NUMBER.fullmatch(wanted.strip("[],;.%")), _NUMBER.fullmatch(word.strip("[],;.%"))
    if numbers[0] is None or numbers[1] is None:
        return wanted == word
    value, other = float(numbers[0][0]), float(numbers[1][0])
    return abs(value - other) <= tolerance * abs(value)
