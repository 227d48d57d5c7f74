"""USART with DMA both ways: RM0390 chapter 25."""

from pathlib import Path

import pytest

from hil_sim.board.elf.errors import RuleViolation
from hil_sim.board.elf.soc import Soc
from tests.hil_sim_elf.snippet import build, results, run

CLOCKS = "REG(0x40023830u) = 1u << 21 | 7u; REG(0x40023840u) = 1u << 17;"
PINS = "REG(0x40020000u) = 0xA8000000u | 2u << 4 | 2u << 6; REG(0x40020020u) = 7u << 8 | 7u << 12;"
SR, DR, BRR, CR1, CR3 = (
    "REG(0x40004400u)",
    "REG(0x40004404u)",
    "REG(0x40004408u)",
    "REG(0x4000440Cu)",
    "REG(0x40004414u)",
)
UE, TE, RE, IDLEIE, RXNEIE = 1 << 13, 1 << 3, 1 << 2, 1 << 4, 1 << 5
SLEEP = 'for (;;) { __asm volatile("wfi"); }'


@pytest.mark.parametrize(("brr", "baud"), [(139, 16e6 / 139), (0x683, 9598.08), (16, 1e6)])
def test_a_byte_takes_ten_bits_of_brr_clocks(tmp_path: Path, brr: int, baud: float) -> None:
    """25.4.4: baud = fCK / (16 * USARTDIV), BRR = 16 * USARTDIV (9.6 kbit/s at 16 MHz: 104.1875)."""
    body = f"""void reset(void) {{ {CLOCKS} {PINS} {BRR} = {brr}; {CR1} = {UE | TE};
        for (int i = 0; i < 5; ++i) {{ while (!({SR} & 1u << 7)) {{}} {DR} = 0x41 + i; }}
        while (!({SR} & 1u << 6)) {{}} out[0] = 1; for (;;) {{}} }}"""
    soc = Soc(build(tmp_path, body))
    assert soc.usart2.value["SR"] == 0xC0
    while soc.usart2.value["SR"] & 1 << 6:
        soc.run_for(1e-6)
    soc.run_for(49.0 / baud)
    assert results(soc, 1) == [0]
    soc.run_for(2.0 / baud)
    assert results(soc, 1) == [1]
    assert bytes(soc.usart2.sent) == b"ABCDE"
    assert soc.usart2.baud == pytest.approx(baud, rel=1e-5)


def test_received_bytes_wait_in_dr_and_the_next_one_overruns(tmp_path: Path) -> None:
    """25.4.3: RXNE with each byte; one that comes while RXNE is set is lost, and ORE says so."""
    body = f"void reset(void) {{ {CLOCKS} {PINS} {BRR} = 139; {CR1} = {UE | RE}; {SLEEP} }}"
    soc = run(tmp_path, body, seconds=1e-4)
    soc.usart2.receive(b"xyz", 115200)
    soc.run_for(10.5 / 115200)
    assert soc.usart2.value["SR"] & 0x28 == 1 << 5
    soc.run_for(10.0 / 115200)
    assert soc.usart2.value["SR"] & 0x28 == 1 << 5 | 1 << 3
    soc.usart2.read_sr()
    assert soc.usart2.read_dr() == ord("x")
    assert soc.usart2.value["SR"] & 0x28 == 0  # reading SR then DR clears both (25.6.1)


def test_idle_interrupt_comes_one_frame_after_the_burst_with_dma_in_both_directions(tmp_path: Path) -> None:
    """25.4.3 (IDLE after a frame of silence, cleared by SR then DR), 25.4.12 (DMA). The program echoes."""
    body = f"""
        void usart(void) {{
            out[0] = out[0] + 1; (void){SR}; (void){DR}; out[1] = REG(0x40026000u + 0x10 + 5 * 0x18 + 4);
            uint32_t count = 64 - out[1];
            REG(0x40026000u + 0x10 + 6 * 0x18 + 4) = count;
            REG(0x40026000u + 0x10 + 6 * 0x18) = 4u << 25 | 1u << 10 | 1u << 6 | 1u;
        }}
        void reset(void) {{ {CLOCKS} {PINS} {BRR} = 16; {CR1} = {UE | RE | TE | IDLEIE}; {CR3} = 3u << 6;
            REG(0x40026000u + 0x10 + 5 * 0x18 + 4) = 64; REG(0x40026000u + 0x10 + 5 * 0x18 + 8) = 0x40004404u;
            REG(0x40026000u + 0x10 + 5 * 0x18 + 12) = 0x20002000u;
            REG(0x40026000u + 0x10 + 5 * 0x18) = 4u << 25 | 1u << 10 | 1u << 8 | 1u;
            REG(0x40026000u + 0x10 + 6 * 0x18 + 8) = 0x40004404u; REG(0x40026000u + 0x10 + 6 * 0x18 + 12) = 0x20002000u;
            REG(0xE000E104u) = 1u << 6; {SLEEP} }}"""
    soc = run(tmp_path, body, {16 + 38: "usart"}, seconds=1e-4)
    soc.usart2.receive(b"hello", 1e6)
    soc.run_for(59e-6)
    assert results(soc, 1) == [0]
    soc.run_for(2e-6)
    assert results(soc, 2) == [1, 59]
    soc.run_for(60e-6)
    assert bytes(soc.usart2.sent) == b"hello"
    assert soc.dmas["DMA1"].streams[6].flags & 1 << 5
    assert results(soc, 1) == [1]  # no second idle without new bytes


def test_a_sender_of_another_speed_is_refused(tmp_path: Path) -> None:
    """25.4.5: the receiver tolerates a few percent."""
    body = f"void reset(void) {{ {CLOCKS} {PINS} {BRR} = 139; {CR1} = {UE | RE}; {SLEEP} }}"
    soc = run(tmp_path, body, seconds=1e-4)
    soc.usart2.receive(b"x", 115200 * 1.06)
    with pytest.raises(RuleViolation, match="cannot receive"):
        soc.run_for(1e-3)


def test_bytes_to_unconnected_pins_do_not_arrive(tmp_path: Path) -> None:
    body = f"void reset(void) {{ {CLOCKS} {BRR} = 139; {CR1} = {UE | RE}; {SLEEP} }}"
    soc = run(tmp_path, body, seconds=1e-4)
    soc.usart2.receive(b"x", 115200)
    soc.run_for(1e-3)
    assert not soc.usart2.value["SR"] & 1 << 5


@pytest.mark.parametrize(("read_first", "done"), [("", 1), (f"(void){SR};", 0)])
def test_tc_stays_set_for_a_writer_that_does_not_look(tmp_path: Path, read_first: str, done: int) -> None:
    """25.6.1: TC is cleared by a read of SR and a write of DR, or by writing 0; a DMA does only the second."""
    body = f"""void reset(void) {{ {CLOCKS} {PINS} {BRR} = 139; {CR1} = {UE | TE}; {read_first} {DR} = 0x55;
        out[0] = {SR} >> 6 & 1; for (;;) {{}} }}"""
    assert results(run(tmp_path, body, seconds=2e-5), 1) == [done]
