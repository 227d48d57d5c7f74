"""Speed and memory of everything that somebody waits for, each beside a peer of the same run (`make bench`).

The programs in bench/ import each other by the names within that folder, as they do when run by their path.
"""

import sys
from pathlib import Path

BENCH = Path(__file__).resolve().parents[1]
sys.path += [str(BENCH), str(BENCH / "recording")]
