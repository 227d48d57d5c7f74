"""What a board says of itself."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class BoardInfo:
    """What a board says of itself; the fields are the INFO items of the message set."""

    protocol_version: int
    firmware_version: int
    uid_0: int
    uid_1: int
    uid_2: int
    boot_id: int
    sample_rate_hz: int
    group_delay_us: int
    full_scale_code: int
    vref_mv: int
    batch_samples: int
    oversampling: int
    reset_cause: int
    clock_source: int
    self_test_x_mv: int
    self_test_y_mv: int
    # None where the firmware does not know the item.
    build_commit: int | None = None
    build_state: int | None = None
    board_id: int | None = None
    update_slot: int | None = None
    update_pending: int | None = None
    external_clock_hz: int | None = None
    sensor: int | None = None
    axes: int | None = None
    reading_bits: int | None = None
    self_test_z_mv: int | None = None


def build_name(board: BoardInfo) -> str:
    """Version, commit and compiler of a board's firmware: `0.2.0 c6d1891a, modified, gcc 12.2.1`."""
    number, state = board.firmware_version, board.build_state
    version = f"{number >> 16}.{number >> 8 & 255}.{number & 255}"
    if state is None or board.build_commit is None:
        return version
    commit = f"{board.build_commit:08x}" if state & 2 else "commit not known"
    compiler = f"{'clang' if state & 4 else 'gcc'} {state >> 24}.{state >> 16 & 255}.{state >> 8 & 255}"
    return f"{version} {commit}, {'modified, ' if state & 1 else ''}{compiler}"
