"""Processor time and peak memory of opening a recording of the simulated day of day.py: whole, as a survey, as
Parquet, and a minute of it.

`opening.py [HOURS [CARRIER]]`. Each in a program of its own, imports included.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

from common import save
from day_file import write

READER = "from impid_host.recording.reader import read_recording, survey\n"
WAYS = {
    "whole": READER + "read_recording(path)",
    "survey": READER + "survey(path)",
    "parquet": "from impid_host.recording.export.tables import write_parquet\n"
    "write_parquet(path, path.with_suffix('.parquet'))",
    "minute": READER
    + "from impid_host.recording.records import Window\nread_recording(path, Window(middle, middle + 60))",
}
PROGRAM = """
import resource, sys, time
from pathlib import Path
path, middle = Path(sys.argv[1]), float(sys.argv[2])
{work}
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
print(f"{{time.process_time():.2f}} s {{peak:.0f}} MB")
"""


def main(hours: float = 1.0, carrier: str = "serial") -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "opened.mcap"
        write(carrier, hours, path)
        found: dict[str, object] = {"megabytes": round(path.stat().st_size / 1e6, 1)}
        for way, work in WAYS.items():
            asked = [sys.executable, "-c", PROGRAM.format(work=work), str(path), str(hours * 1800)]
            done = subprocess.run(asked, check=True, capture_output=True, text=True)
            found[way] = done.stdout.strip()
    save(f"opening_{carrier}", hours=hours, **found)


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 1.0, *sys.argv[2:])
