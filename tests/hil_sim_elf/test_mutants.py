"""A sample of bench/firmware_mutants.py: the checks pass on what ships, and mistakes of each kind fail them."""

from pathlib import Path

import pytest
from firmware_mutation.checks import first_failure
from firmware_mutation.mutants import Workshop, mutants

from hil_sim.board.elf.wiring import CUSTOM, NUCLEO, Wiring

# A register, an order of writes, a priority, a board header, the loader.
SAMPLE = {
    "DDS missing": "no STATUS",
    "data cache not flushed after an erase": "without a flush of the data cache",
    "stamps below the tick": "stamped",
    "sync on another pin": "flags differs",
    "a trial is never marked": "on trial for ever",
}


@pytest.mark.parametrize(("name", "wiring"), [("firmware", NUCLEO), ("custom_firmware", CUSTOM)])
def test_what_ships_passes_every_check(name: str, wiring: Wiring, request: pytest.FixtureRequest) -> None:
    assert first_failure(request.getfixturevalue(name), wiring) is None


def test_every_mistake_applies_to_the_firmware_as_it_is() -> None:
    sources = Path(__file__).resolve().parents[2] / "firmware"
    stale = [m.what for m in mutants() if (sources / m.file).read_text(encoding="utf-8").count(m.old) != 1]
    assert stale == []


def test_mistakes_are_noticed(firmware: Path, tmp_path: Path) -> None:
    workshop = Workshop(tmp_path)
    chosen = {mutant.what: mutant for mutant in mutants() if mutant.what in SAMPLE}
    assert chosen.keys() == SAMPLE.keys()
    for what, symptom in SAMPLE.items():
        failure = first_failure(workshop.build(chosen[what]), NUCLEO)
        assert failure is not None, what
        assert symptom in failure
