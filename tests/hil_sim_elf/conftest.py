"""The binary under test, built as it ships."""

import fcntl
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def built(board: str) -> Path:
    """The ELF that `pio run -e <board>` builds, brought up to date first."""
    lock = ROOT / "build" / "firmware-for-tests.lock"
    lock.parent.mkdir(exist_ok=True)
    with lock.open("w") as held:
        fcntl.flock(held, fcntl.LOCK_EX)  # several test processes want the same build
        done = subprocess.run(
            [ROOT / "scripts" / "pio.sh", "run", "--silent", "-e", board],
            capture_output=True,
            text=True,
            check=False,
        )
    if done.returncode:
        pytest.fail(f"the firmware does not build:\n{done.stdout}{done.stderr}", pytrace=False)
    return ROOT / ".pio" / "build" / board / "firmware.elf"


@pytest.fixture(scope="session")
def firmware() -> Path:
    """What ships for the Nucleo."""
    return built("nucleo_f446re")


@pytest.fixture(scope="session")
def digital_firmware() -> Path:
    """What ships for the Nucleo with an ADXL355."""
    return built("nucleo_f446re_adxl355")


@pytest.fixture(scope="session")
def custom_firmware() -> Path:
    """What a board of one's own would run."""
    return built("custom_f446re")
