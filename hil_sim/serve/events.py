"""One JSON object per line on standard output: what happens, for whoever started the simulator."""

import json
import os
import sys
from pathlib import Path
from typing import Any


def say(**content: Any) -> None:
    """Writes one line."""
    try:
        print(json.dumps(content), flush=True)  # noqa: T201
    except BrokenPipeError:
        # Whoever listened has gone; the board does not depend on it.
        sys.stdout = Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115


def warn(text: str) -> None:
    """Writes one line to standard error."""
    print(f"impid-sim: {text}", file=sys.stderr, flush=True)  # noqa: T201
