"""How long a command takes to say anything: processor time of the whole process."""

import os
import resource
import subprocess
import sys

from speed.measure import ROOT

_CODE = "import sys; from impid_host.cli import main; sys.argv[0] = 'impid-host'; main()"
# Bad input: the command starts whole, reads, and ends at once.
STARTS = (
    ("fit", "nowhere/"),
    ("check", "nowhere/"),
    ("diagnose", "nowhere/"),
    ("compare", "nowhere/"),
    ("info", "no.mcap"),
)


def bare() -> float:
    """Python itself."""
    return _spent(["-c", "pass"])


def started(*arguments: str) -> float:
    """`impid-host` with these arguments."""
    return _spent(["-c", _CODE, *arguments])


def _spent(arguments: list[str], times: int = 3) -> float:
    """The least of several runs, s."""
    path = os.pathsep.join([str(ROOT / "host"), str(ROOT)])
    costs = []
    for _ in range(times):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(
            [sys.executable, *arguments],
            env={**os.environ, "PYTHONPATH": path},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            check=False,
        )
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        costs.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return min(costs)
