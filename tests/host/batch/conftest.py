"""Studies in closed form, written as folders: the truth of every number is known."""

from pathlib import Path

import pytest

from tests.host.batch.studies_in_closed_form import Done, batch, write_archive


@pytest.fixture
def archive(tmp_path: Path) -> Path:
    """Two subjects on two days each."""
    write_archive(tmp_path / "archive", 2, 2)
    return tmp_path / "archive"


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Done:
    """An archive of four studies and its results, for tests that change neither."""
    folder = tmp_path_factory.mktemp("done")
    write_archive(folder / "archive", 2, 2)
    return Done(folder / "archive", folder / "out", batch(folder / "archive", folder / "out", jobs=2))
