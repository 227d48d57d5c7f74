"""Processor time and peak memory of `fit` and `diagnose` on random studies of several sizes.

    python bench/diagnose_speed.py

Each row is a process of its own, one thread for linear algebra; time is that of the process itself, imports taken off.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

from hil_sim.scenarios.random import Size, random_scenario
from hil_sim.study.write import write_study

ROWS = (
    ("fit, one trial of 50 s", "fit", Size(free=1, loads=0, per_load=0, duration_s=50.0)),
    ("fit, 8 trials of 50 s", "fit", Size(free=4, loads=2, per_load=2, duration_s=50.0)),
    ("diagnose, 4 trials of 30 s", "diagnose", Size(free=2, loads=1, per_load=2, duration_s=30.0)),
    ("diagnose, 8 trials of 50 s", "diagnose", Size(free=4, loads=2, per_load=2, duration_s=50.0)),
    ("diagnose, 16 trials of 50 s", "diagnose", Size(free=4, loads=4, per_load=3, duration_s=50.0)),
)
PROGRAM = """
import json, resource, sys, time
import impid_host
study = impid_host.read_study(sys.argv[2])
work = getattr(impid_host, sys.argv[1])
begin, wall = time.process_time(), time.monotonic()
work(study)
spent = time.process_time() - begin, time.monotonic() - wall
print(json.dumps([*spent, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024]))
"""


def main() -> None:
    """Print a table."""
    print("| what | processor time, s | wall time, s | peak memory, MB |\n| --- | --- | --- | --- |")
    for words, what, size in ROWS:
        with tempfile.TemporaryDirectory() as folder:
            study = Path(folder) / "study"
            scenario, _ = random_scenario(31, size, ("elastic.cartesian@tip",), 4.0)
            write_study(scenario, study, 31)
            command = [sys.executable, "-c", PROGRAM, what, str(study)]
            done = subprocess.run(command, capture_output=True, text=True, check=True)
        cpu, wall, memory = json.loads(done.stdout.splitlines()[-1])
        print(f"| {words} | {cpu:.2f} | {wall:.2f} | {memory:.0f} |", flush=True)


if __name__ == "__main__":
    main()
