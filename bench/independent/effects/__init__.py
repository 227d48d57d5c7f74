"""Hidden effects: three files with names of the catalogue, four ``odd_`` files without."""

from __future__ import annotations

from . import loads, machine, odd_drives, odd_loads, odd_machine, odd_sensing, sensing
from .base import Effect

NAMED: dict[str, type[Effect]] = {e.key(): e for e in (*machine.ALL, *sensing.ALL, *loads.ALL)}
UNNAMED: dict[str, type[Effect]] = {
    e.key(): e for e in (*odd_machine.ALL, *odd_drives.ALL, *odd_sensing.ALL, *odd_loads.ALL)
}
EVERY = {**NAMED, **UNNAMED}

__all__ = ["EVERY", "NAMED", "UNNAMED", "Effect"]
