"""The boards of the recording's benches, which are scripts beside each other."""

import sys

from bench.speed.measure import ROOT

sys.path.append(str(ROOT / "bench" / "recording"))
import day
import day_file
import load

__all__ = ["day", "day_file", "load"]
