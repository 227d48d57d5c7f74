"""Flash programming and erasing: RM0390 3.3, 3.5 and 3.8."""

from pathlib import Path

import pytest

from hil_sim.board.elf.errors import PowerCut, RuleViolation
from hil_sim.board.elf.flash import Cut, sector_range
from hil_sim.board.elf.soc import Soc
from tests.hil_sim_elf.snippet import build, results, run

KEYR, SR, CR = "REG(0x40023C04u)", "REG(0x40023C0Cu)", "REG(0x40023C10u)"
UNLOCK = f"{KEYR} = 0x45670123u; {KEYR} = 0xCDEF89ABu;"
WORD = "REG(0x08008000u)"
PSIZE32 = "2u << 8"
BRANCH = '__asm volatile("b 1f\\n1:");'  # time passes between blocks of instructions


def test_locked_after_reset_and_unlocked_by_the_two_keys(tmp_path: Path) -> None:
    soc = run(tmp_path, f"void reset(void) {{ out[0] = {CR}; {UNLOCK} out[1] = {CR}; for (;;) {{}} }}")
    assert results(soc, 2) == [1 << 31, 0]


def test_wrong_key_is_refused(tmp_path: Path) -> None:
    """3.5.2: a wrong sequence locks FLASH_CR until the next reset and raises a bus error."""
    with pytest.raises(RuleViolation, match=r"3\.5\.2"):
        run(tmp_path, f"void reset(void) {{ {KEYR} = 0xCDEF89ABu; for (;;) {{}} }}")


def test_programming_clears_bits_only(tmp_path: Path) -> None:
    """3.5.4: programming takes bits from 1 to 0; setting them again needs an erase."""
    soc = run(
        tmp_path,
        f"""void reset(void) {{
            {UNLOCK} {CR} = 1u | {PSIZE32};
            out[0] = {WORD}; {WORD} = 0xFFFF00FFu; __asm volatile("b 1f\\n1:"); out[1] = {WORD};
            {WORD} = 0x0F0FFFFFu; __asm volatile("b 1f\\n1:"); out[2] = {WORD}; out[3] = {SR};
            for (;;) {{}} }}""",
    )
    assert results(soc, 4) == [0xFFFF_FFFF, 0xFFFF_00FF, 0x0F0F_00FF, 0]


@pytest.mark.parametrize(
    ("prepare", "statement", "flag"),
    [
        ("", f"{WORD} = 0;", 1 << 7),  # locked, PG clear: sequence error
        (UNLOCK, f"{WORD} = 0;", 1 << 7),  # PG clear
        (f"{UNLOCK} {CR} = 1u;", f"{WORD} = 0;", 1 << 6),  # PSIZE x8, written as a word
        (f"{UNLOCK} {CR} = 1u | {PSIZE32};", "BYTE(0x08008000u) = 0;", 1 << 6),
    ],
)
def test_refused_writes_set_their_flag_and_leave_the_memory(
    tmp_path: Path, prepare: str, statement: str, flag: int
) -> None:
    """3.8.4: PGSERR for a wrong sequence, PGPERR for a width other than PSIZE."""
    soc = run(
        tmp_path,
        f"""void reset(void) {{ {prepare} {statement} __asm volatile("b 1f\\n1:");
            out[0] = {SR}; out[1] = {WORD}; {SR} = 0xF2u; out[2] = {SR}; for (;;) {{}} }}""",
    )
    assert results(soc, 3) == [flag, 0xFFFF_FFFF, 0]


def test_sector_erase_fills_exactly_its_sector_and_takes_its_time(tmp_path: Path) -> None:
    """3.3: sectors 0 to 3 of 16 KB, 4 of 64 KB, 5 to 7 of 128 KB. 3.5.3: SER, SNB, STRT."""
    body = f"void reset(void) {{ {UNLOCK} {CR} = 1u << 1 | 2u << 3 | {PSIZE32} | 1u << 16; {BRANCH} out[0] = 1; for (;;) {{}} }}"
    memory = build(tmp_path, body)
    memory.flash[0x4000:0x10000] = bytes(0xC000)
    soc = Soc(memory)
    soc.run_for(0.24)
    assert results(soc, 1) == [0]  # the processor waits for the bank it runs from
    soc.run_for(0.02)
    assert results(soc, 1) == [1]
    assert bytes(memory.flash[0x4000:0x8000]) == bytes(0x4000)
    assert bytes(memory.flash[0x8000:0xC000]) == b"\xff" * 0x4000
    assert bytes(memory.flash[0xC000:0x10000]) == bytes(0x4000)
    assert [sector_range(n) for n in (3, 4, 5, 7)] == [
        (0xC000, 0x4000),
        (0x10000, 0x10000),
        (0x20000, 0x20000),
        (0x60000, 0x20000),
    ]


def test_control_register_is_locked_again(tmp_path: Path) -> None:
    with pytest.raises(RuleViolation, match="locked"):
        run(tmp_path, f"void reset(void) {{ {UNLOCK} {CR} = 1u << 31; {CR} = 1u; for (;;) {{}} }}")


@pytest.mark.parametrize("kept", [0, 1, 3])
def test_power_cut_in_the_middle_of_a_word(tmp_path: Path, kept: int) -> None:
    body = f"void reset(void) {{ {UNLOCK} {CR} = 1u | {PSIZE32}; {WORD} = 0; REG(0x08008004u) = 0; for (;;) {{}} }}"
    soc = Soc(build(tmp_path, body))
    soc.flash.cut = Cut(operations=1, bytes_kept=kept)
    with pytest.raises(PowerCut):
        soc.run_for(1e-3)
    assert soc.memory.read_bytes(0x0800_8000, 8) == bytes(4) + bytes(kept) + b"\xff" * (4 - kept)


@pytest.mark.parametrize("flush", [False, True])
def test_what_was_erased_is_read_after_a_flush_of_the_data_cache_alone(tmp_path: Path, flush: bool) -> None:
    """3.5.3: the data cache may hold what was erased. It is reset while it is off (3.8.1)."""
    acr = "REG(0x40023C00u)"
    caches = f"{acr} = 0; {acr} = 1u << 12; {acr} = 0; {acr} = 1u << 10;" if flush else ""
    body = f"""void reset(void) {{ {acr} = 1u << 10; {UNLOCK} {CR} = 1u << 1 | 2u << 3 | {PSIZE32} | 1u << 16; {BRANCH}
        {caches} out[0] = REG(0x0800C000u); {BRANCH} out[1] = {WORD}; for (;;) {{}} }}"""
    memory = build(tmp_path, body)
    memory.flash[0x8000:0xC004] = bytes(0x4004)
    soc = Soc(memory)
    if flush:
        soc.run_for(0.3)
        assert results(soc, 2) == [0, 0xFFFF_FFFF]
    else:
        with pytest.raises(RuleViolation, match="0x08008000 read after an erase"):
            soc.run_for(0.3)
