"""Holds an installed impid against what it is for: a study is fitted; where it is there, a board simulated.

Run by a Python that has the wheel, outside the checkout. Needs no test library.
"""

import importlib.util
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import impid_host
from impid_host.example import K_N_PER_M, MASS_KG
from impid_host.study.folder import write_study

RUN = "import sys; from {} import main; sys.exit(main())"


def main() -> None:
    """Raises AssertionError where something is not as it should be."""
    checkout = Path(__file__).resolve().parents[2]
    place = Path(impid_host.__file__).resolve()
    assert not place.is_relative_to(checkout), f"{place} is the checkout's, not an installed one"
    with tempfile.TemporaryDirectory() as name:
        study, told = Path(name) / "study", Path(name) / "told.json"
        write_study(impid_host.example_study(), study)
        command("impid_host.cli", "fit", str(study), "--json", str(told))
        load = json.loads(told.read_text(encoding="utf-8"))["loads"]["spring"]["method1"]
        for axis in range(2):
            assert abs(load["M"]["value"][axis][axis] - MASS_KG) < 0.02, load["M"]
            assert abs(load["K"]["value"][axis][axis] / K_N_PER_M[axis][axis] - 1) < 0.02, load["K"]
    if is_there("hil_sim._native") and is_there("cffi"):
        listed = command("hil_sim.cli", "list")
        assert "first-light" in listed, listed
        from hil_sim.board.native import BoardConfig, NativeBoard  # noqa: PLC0415  (an extra)

        NativeBoard(BoardConfig(start_us=0))
    sys.stdout.write(f"impid {impid_host.__version__} as installed in {place.parent}: ok\n")


def is_there(name: str) -> bool:
    """Whether it could be imported; one that somebody keeps from being found is not there."""
    try:
        return importlib.util.find_spec(name) is not None
    except ModuleNotFoundError:
        return False


def command(module: str, *arguments: str) -> str:
    """What a command prints."""
    done = subprocess.run(
        [sys.executable, "-c", RUN.format(module), *arguments],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, f"{module} {arguments}: {done.stderr[-1500:]}"
    return done.stdout


if __name__ == "__main__":
    main()
