"""Processor time of every `impid-host` command until it opens what it was given, which here is not there.

A command that waits for a board is asked for a port that does not exist; `init` for its help, after its imports.
Of each the least of some runs, since whatever else the machine does only adds. Also `--help`, and a Python that
loads numpy alone.
"""

import os
import resource
import subprocess
import sys

_NO = "no-such-place"
_RUN = "from impid_host.cli import main; main()"
COMMANDS: dict[str, list[str]] = {
    "--help": ["--help"],
    "doctor": ["doctor", "--help"],
    "init": ["init", "--help"],
    "record": ["record", "--port", f"/dev/{_NO}", "--out", "x.mcap"],
    "info": ["info", f"{_NO}.mcap"],
    "device info": ["device", "info", "--port", f"/dev/{_NO}"],
    "sync": ["sync", _NO],
    "check": ["check", _NO],
    "fit": ["fit", _NO],
    "diagnose": ["diagnose", _NO],
    "report": ["report", _NO, "--out", "x.html"],
    "compare": ["compare", _NO, _NO + "2"],
    "judge": ["judge", f"{_NO}.json", _NO],
    "import": ["import", f"{_NO}.csv", "--mapping", f"{_NO}.toml", "--out", "x"],
    "export": ["export", f"{_NO}.mcap", "--out", "x"],
    "design reference": ["design", "reference", "--setup", f"{_NO}.toml", "--out", "x.csv"],
    "design trial": ["design", "trial", _NO, "--for", f"{_NO}.json"],
}
_RUNS = 5


def main() -> None:
    """Prints one line for each command."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else _RUNS
    print(f"{'numpy alone':18s}{least_s(['-c', 'import numpy'], runs):6.2f} s")
    for name, arguments in COMMANDS.items():
        print(f"{name:18s}{least_s(['-c', _RUN, *arguments], runs):6.2f} s")


def least_s(arguments: list[str], runs: int) -> float:
    """Least processor time of a Python with these arguments, s."""
    took = []
    for _ in range(runs):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run(
            [sys.executable, *arguments],
            capture_output=True,
            text=True,
            check=False,
            env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
        )
        if "Traceback" in done.stderr:
            raise SystemExit(f"{' '.join(arguments)}:\n{done.stderr}")
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        took.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return min(took)


if __name__ == "__main__":
    main()
