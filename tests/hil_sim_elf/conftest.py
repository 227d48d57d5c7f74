"""The binary under test, built as it ships; and the folder's own helpers made importable."""

import fcntl
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BINARY = ROOT / ".pio" / "build" / "nucleo_f446re" / "firmware.elf"

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="session")
def firmware() -> Path:
    """The ELF that `pio run -e nucleo_f446re` builds, brought up to date first."""
    lock = ROOT / "build" / "firmware-for-tests.lock"
    lock.parent.mkdir(exist_ok=True)
    with lock.open("w") as held:
        fcntl.flock(held, fcntl.LOCK_EX)  # several test processes want the same build
        built = subprocess.run(
            [ROOT / "scripts" / "pio.sh", "run", "--silent", "-e", "nucleo_f446re"],
            capture_output=True,
            text=True,
            check=False,
        )
    if built.returncode:
        pytest.fail(f"the firmware does not build:\n{built.stdout}{built.stderr}", pytrace=False)
    return BINARY
