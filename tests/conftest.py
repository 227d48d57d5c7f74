"""Fixtures that every test may use."""

import os
import sys
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parent.parent

# Tests are imported by path, which puts no folder on the module path. Helpers beside them have their full
# names (`tests.host.recording.boards`), the parts of programs the names within their folder, as where those
# run. These folders come last: bench/coverage.py must not stand before the package of that name.
sys.path.insert(0, str(CHECKOUT))
sys.path += [str(CHECKOUT / "bench"), str(CHECKOUT / "scripts")]


@pytest.fixture(scope="session")
def measured_data() -> Path:
    """The folder of measured data: `IMPID_DATA`, or `shared/data` beside the checkout. Mark users `measured`.

    Without the data the test is skipped with a reason that says so. A wrong `IMPID_DATA` fails, since
    whoever set it meant the tests to run.
    """
    named = os.environ.get("IMPID_DATA")
    folder = Path(named) if named else CHECKOUT.parent / "shared" / "data"
    if (folder / "emps").is_dir():
        return folder
    if named:
        pytest.fail(
            f"IMPID_DATA names {folder}, which holds no folder `emps`; see docs/data.md", pytrace=False
        )
    pytest.skip(f"measured data not found at {folder}; set IMPID_DATA to their folder (docs/data.md)")
