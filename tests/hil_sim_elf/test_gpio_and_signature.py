"""Ports and the device signature: RM0390 chapters 7 and 34."""

from pathlib import Path

from hil_sim.board.elf.soc import Soc
from tests.hil_sim_elf.snippet import build, results, run


def test_output_set_reset_and_inputs(tmp_path: Path) -> None:
    """7.4.7: BS wins over BR. 7.4.4: an undriven input follows its pull. 7.4.1: reset values of ports A, B."""
    body = """void reset(void) { REG(0x40023830u) = 7u;
        out[0] = REG(0x40020000u); out[1] = REG(0x40020400u); out[2] = REG(0x40020800u);
        REG(0x40020800u) = 1u << 10; REG(0x40020818u) = 1u << 5; out[3] = REG(0x40020810u) >> 5 & 1;
        REG(0x40020818u) = 1u << 21 | 1u << 5; out[4] = REG(0x40020814u);
        REG(0x40020818u) = 1u << 21; out[5] = REG(0x40020810u) >> 5 & 1;
        REG(0x4002080Cu) = 1u << 12 | 2u << 14; out[6] = REG(0x40020810u) >> 6 & 3;
        for (;;) { out[7] = REG(0x40020810u) >> 6 & 3; } }"""
    soc = run(tmp_path, body, seconds=1e-3)
    assert results(soc, 8) == [0xA800_0000, 0x0280, 0, 1, 1 << 5, 0, 1, 1]
    soc.gpio["C"].drive(7, True)
    soc.gpio["C"].drive(6, False)
    soc.run_for(1e-4)
    assert results(soc, 8)[7] == 2


def test_unique_identity(tmp_path: Path) -> None:
    """34.1: 96 bits at 0x1FFF7A10; 34.2: flash size in Kbytes at 0x1FFF7A22."""
    body = """void reset(void) { out[0] = REG(0x1FFF7A10u); out[1] = REG(0x1FFF7A14u); out[2] = REG(0x1FFF7A18u);
        out[3] = *(volatile uint16_t *)0x1FFF7A22u; for (;;) {} }"""
    soc = Soc(build(tmp_path, body), uid=(11, 22, 33))
    soc.run_for(1e-3)
    assert results(soc, 4) == [11, 22, 33, 512]
