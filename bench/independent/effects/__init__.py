"""Hidden effects: three files with names of the catalogue, four ``odd_`` files without.

The second books are judged apart: ``fresh_`` files without a name, ``varied_`` files with names in other forms.
"""

from __future__ import annotations

from . import (
    fresh_drives,
    fresh_loads,
    fresh_machine,
    fresh_sensing,
    loads,
    machine,
    odd_drives,
    odd_loads,
    odd_machine,
    odd_sensing,
    sensing,
    varied,
    varied_sensing,
)
from .base import Effect

Book = dict[str, type[Effect]]


def _book(*lists: list[type[Effect]]) -> Book:
    return {kind.key(): kind for some in lists for kind in some}


NAMED = _book(machine.ALL, sensing.ALL, loads.ALL)
UNNAMED = _book(odd_machine.ALL, odd_drives.ALL, odd_sensing.ALL, list(odd_loads.ALL))
UNNAMED2 = _book(fresh_machine.ALL, fresh_drives.ALL, fresh_sensing.ALL, fresh_loads.ALL)
NAMED2 = _book(varied.ALL, varied_sensing.ALL)
EVERY = {**NAMED, **UNNAMED, **NAMED2, **UNNAMED2}

__all__ = ["EVERY", "NAMED", "NAMED2", "UNNAMED", "UNNAMED2", "Effect"]
