"""Markdown tables and numbers with their scatter."""

from collections.abc import Sequence

import numpy as np


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """The lines of a Markdown table."""
    return [
        "| " + " | ".join(head) + " |",
        "| " + " | ".join("---" for _ in head) + " |",
        *("| " + " | ".join(row) + " |" for row in rows),
    ]


def mean_sd(mean: float, sd: float) -> str:
    """Both to the digits that two figures of `sd` support."""
    digits = int(np.clip(1 - np.floor(np.log10(sd)), 0, 6)) if sd > 0 else 3
    return f"{mean:.{digits}f} ± {sd:.{digits}f}"
