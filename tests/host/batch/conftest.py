"""Studies in closed form, written as folders: the truth of every number is known."""

import sys
from pathlib import Path

import pytest

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1] / "report")]


@pytest.fixture
def archive(tmp_path: Path) -> Path:
    """Two subjects on two days each."""
    from studies_in_closed_form import write_archive  # noqa: PLC0415  (found by the line above)

    write_archive(tmp_path / "archive", 2, 2)
    return tmp_path / "archive"


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory):
    """An archive of four studies and its results, for tests that change neither."""
    from studies_in_closed_form import Done, batch, write_archive  # noqa: PLC0415

    folder = tmp_path_factory.mktemp("done")
    write_archive(folder / "archive", 2, 2)
    return Done(folder / "archive", folder / "out", batch(folder / "archive", folder / "out", jobs=2))
