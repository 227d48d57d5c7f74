"""Processor time and peak memory of opening a recording of the simulated day of day.py: whole, as a survey, as
Parquet, and a minute of it.

`opening.py [HOURS [CARRIER]]`. Each in a process of its own.
"""

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from common import save
from day_file import write
from impid_host.recording.export.tables import write_parquet
from impid_host.recording.reader import read_recording, survey
from impid_host.recording.records import Window

WAYS = ("whole", "survey", "parquet", "minute")


def work(way: str, path: Path, hours: float) -> dict[str, float]:
    """Open it that way; seconds of this process' processor time and its peak in MB."""
    began = time.process_time()
    if way == "whole":
        read_recording(path)
    elif way == "survey":
        survey(path)
    elif way == "parquet":
        write_parquet(path, path.with_suffix(".parquet"))
    else:
        middle = hours * 1800
        read_recording(path, Window(middle, middle + 60))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    return {"cpu_s": round(time.process_time() - began, 2), "peak_MB": round(peak)}


def main(hours: float = 1.0, carrier: str = "serial") -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "opened.mcap"
        write(carrier, hours, path)
        found = {"megabytes": round(path.stat().st_size / 1e6, 1)}
        for way in WAYS:
            asked = [sys.executable, __file__, "--way", way, str(path), str(hours)]
            done = subprocess.run(asked, check=True, capture_output=True, text=True)
            found[way] = done.stdout.strip()
    save(f"opening_{carrier}", hours=hours, **found)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--way"]:
        print(work(sys.argv[2], Path(sys.argv[3]), float(sys.argv[4])))
    else:
        main(*(float(a) if a.replace(".", "").isdigit() else a for a in sys.argv[1:]))
