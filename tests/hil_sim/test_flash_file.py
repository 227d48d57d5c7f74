"""The flash of a simulated board in a file."""

from dataclasses import replace
from pathlib import Path

import pytest

from hil_sim.board.flash_file import open_flash
from hil_sim.board.native import FLASH_BYTES, BoardConfig, NativeBoard
from hil_sim.errors import SimError


def test_a_new_one_is_erased_and_boots_count_in_it(tmp_path: Path) -> None:
    path = tmp_path / "board.flash"
    config = BoardConfig(flash=open_flash(path))
    assert path.read_bytes() == b"\xff" * FLASH_BYTES
    NativeBoard(config).close()
    once = path.read_bytes()
    NativeBoard(replace(config, flash=open_flash(path))).close()
    assert once != b"\xff" * FLASH_BYTES
    assert path.read_bytes() != once


def test_what_is_no_flash_is_refused_and_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "notes.txt"
    path.write_text("not a flash")
    with pytest.raises(SimError, match=r"notes.txt: 11 bytes are no flash of a board \(32768\)"):
        open_flash(path)
    assert path.read_text() == "not a flash"
    with pytest.raises(SimError, match="No such file or directory; name a place"):
        open_flash(tmp_path / "nowhere" / "board.flash")
