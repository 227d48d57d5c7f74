"""Boards on pseudo-terminals, and where to record."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.host.recording.boards import PtyBoard


@pytest.fixture
def board() -> Iterator[PtyBoard]:
    """A board in real time."""
    board = PtyBoard()
    yield board
    board.close()


@pytest.fixture
def fast_board() -> Iterator[PtyBoard]:
    """A board at ten times real time, on a line that is as much faster."""
    board = PtyBoard(speed=10.0)
    yield board
    board.close()


@pytest.fixture
def out(tmp_path: Path) -> Path:
    """Where to record."""
    return tmp_path / "free_01.mcap"
