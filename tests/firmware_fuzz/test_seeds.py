"""The committed seeds are those that the golden session and the message set give today."""

import runpy
from pathlib import Path

HERE = Path(__file__).resolve().parent


def test_seeds_are_up_to_date() -> None:
    makers = runpy.run_path(str(HERE / "make_seeds.py"))["SEEDS"]
    for target, seeds in makers.items():
        stored = {path.name: path.read_bytes() for path in (HERE / "seeds" / target).iterdir()}
        assert stored == seeds(), f"{target}: run tests/firmware_fuzz/make_seeds.py"
