"""bxCAN: RM0390 chapter 30, and fault confinement as ISO 11898-1 has it."""

from pathlib import Path

import pytest

from hil_sim.board.elf.can import RECOVERY_BITS
from hil_sim.board.elf.can_frame import Frame, frame_bits
from hil_sim.board.elf.errors import RuleViolation
from hil_sim.board.elf.soc import Soc
from tests.hil_sim_elf.snippet import build, results, run

BASE = 0x4000_6400
CLOCKS = "REG(0x40023830u) = 2u; REG(0x40023840u) = 1u << 25;"
PINS = "REG(0x40020400u) = 0x280u | 2u << 16 | 2u << 18; REG(0x40020424u) = 9u | 9u << 4;"


def reg(offset: int) -> str:
    return f"REG(0x{BASE + offset:08X}u)"


MCR, MSR, TSR, RF0R, IER, ESR, BTR = (reg(offset) for offset in (0, 4, 8, 12, 0x14, 0x18, 0x1C))
# 16 MHz / 1 / (1 + 13 + 2) = 1 Mbit/s (30.7.7).
NORMAL = f"""{CLOCKS} {PINS} {MCR} = 1u | {{bits}}u; while (!({MSR} & 1)) ; {BTR} = 12u << 16 | 1u << 20;
    {reg(0x200)} |= 1; {reg(0x20C)} = 1; {reg(0x204)} = {{listed}}; {reg(0x240)} = {{first}}u; {reg(0x244)} = {{second}}u;
    {reg(0x21C)} = 1; {reg(0x200)} &= ~1u; {MCR} = {{bits}}u; while ({MSR} & 1) ;"""
SLEEP = 'for (;;) { __asm volatile("wfi"); }'


def normal(bits: int = 0, listed: int = 1, first: int = 0x100 << 21, second: int = 0x100 << 21) -> str:
    return NORMAL.format(bits=bits, listed=listed, first=first, second=second)


def send(box: int, identifier: int, words: tuple[int, int] = (0, 0), length: int = 8) -> str:
    base = 0x180 + 16 * box
    return (
        f"{reg(base + 4)} = {length}; {reg(base + 8)} = {words[0]}u; {reg(base + 12)} = {words[1]}u; "
        f"{reg(base)} = {identifier << 21 | 1}u; "
    )


def test_modes_after_reset(tmp_path: Path) -> None:
    """30.4: sleep after reset; INRQ is acknowledged by INAK; normal mode follows after 11 recessive bits."""
    body = f"""void reset(void) {{ {CLOCKS} {PINS} out[0] = {MSR} & 3; {MCR} = 1; out[1] = {MSR} & 3;
        {BTR} = 12u << 16 | 1u << 20; {MCR} = 0; out[2] = {MSR} & 3; while ({MSR} & 1) {{}} out[3] = {MSR} & 3; for (;;) {{}} }}"""
    soc = run(tmp_path, body)
    assert results(soc, 4) == [2, 1, 1, 0]
    assert soc.can1.bit_rate == 1e6


@pytest.mark.parametrize(("fifo", "order"), [(0, [0x300, 0x080, 0x200]), (1 << 2, [0x300, 0x200, 0x080])])
def test_mailbox_priority(tmp_path: Path, fifo: int, order: list[int]) -> None:
    """30.7.1: by identifier, or with TXFP by order of request; what is on the bus already stays first."""
    body = f"""void reset(void) {{ {normal(fifo)} {send(0, 0x300)} {send(1, 0x200)} {send(2, 0x080)}
        out[0] = {TSR} >> 26; {SLEEP} }}"""
    soc = run(tmp_path, body, seconds=2e-3)
    assert [frame.identifier for frame in soc.can1.sent] == order
    assert results(soc, 1) == [0]


def test_transmission_takes_its_bits_and_raises_rqcp(tmp_path: Path) -> None:
    """30.7.1: TXOK and RQCP at the end, TME again; the interrupt comes with TMEIE; a one clears RQCP."""
    body = f"""
        void tx(void) {{ out[0] = out[0] + 1; out[1] = {TSR}; {TSR} = 1; out[2] = {TSR}; }}
        void reset(void) {{ {normal()} {IER} = 1; REG(0xE000E100u) = 1u << 19; {send(0, 0x123, (0x04030201, 0x08070605))}
        {SLEEP} }}"""
    soc = Soc(build(tmp_path, body, {16 + 19: "tx"}))
    soc.run_for(1e-3)
    assert soc.can1.sent == [Frame(0x123, bytes(range(1, 9)))]
    count, during, after = results(soc, 3)
    assert count == 1
    assert during & 0xFF == 3
    assert during >> 26 == 7
    assert after & 0xFF == 0
    # ISO 11898-1: 44 bits of overhead, 64 of data, 3 between frames, at most 24 stuff bits.
    assert frame_bits(8) == 135


@pytest.mark.parametrize(
    ("listed", "second", "accepted"),
    [(1, 0x105 << 21, [0x100, 0x105]), (0, 0x7F8 << 21, [0x100, 0x101, 0x105])],
)
def test_filters_by_list_and_by_mask(tmp_path: Path, listed: int, second: int, accepted: list[int]) -> None:
    """30.7.4: list mode takes the two identifiers; mask mode those that agree in the masked bits."""
    soc = run(tmp_path, f"void reset(void) {{ {normal(0, listed, 0x100 << 21, second)} {SLEEP} }}")
    for identifier in (0x100, 0x101, 0x105, 0x108, 0x200):
        soc.can1.receive(identifier, b"\x01")
    soc.run_for(2e-3)
    assert [frame.identifier for frame in soc.can1.fifos[0]] == accepted


def test_fifo_of_three_overruns_and_is_released_one_by_one(tmp_path: Path) -> None:
    """30.7.3: three stages; FULL, then FOVR with the last one overwritten unless locked; RFOM frees one."""
    body = f"""void reset(void) {{ {normal()} {SLEEP} }}"""
    soc = run(tmp_path, body)
    can = soc.can1
    for number in range(4):
        can.receive(0x100, bytes([number]))
    soc.run_for(1e-3)
    assert can.read_rf0r() == 3 | 1 << 3 | 1 << 4
    assert [frame.data[0] for frame in can.fifos[0]] == [0, 1, 3]
    can.write_rf0r(1 << 5)
    assert can.read_rf0r() & 0xB == 2
    assert can.read(0x1B8, 4) & 0xFF == 1
    assert can.read(0x1B4, 4) & 0xF == 1


def test_reception_interrupt_stays_until_the_fifo_is_empty(tmp_path: Path) -> None:
    """30.8: FMPIE0 is on as long as messages are pending; PM0214 4.3.9: a level pends again."""
    body = f"""
        void rx(void) {{ out[1 + out[0]] = {reg(0x1B8)}; out[0] = out[0] + 1; {RF0R} = 1u << 5; }}
        void reset(void) {{ {normal()} {IER} = 2; __asm volatile("cpsid i"); {SLEEP} }}"""
    soc = run(tmp_path, body, {16 + 20: "rx"})
    for number in (7, 8, 9):
        soc.can1.receive(0x100, bytes([number]))
    soc.run_for(1e-3)
    soc.cpu.set_register("primask", 0)
    soc.nvic.enabled.add(16 + 20)
    soc.interrupts_changed()
    soc.run_for(1e-3)
    assert results(soc, 4) == [3, 7, 8, 9]


def test_bus_off_and_automatic_recovery(tmp_path: Path) -> None:
    """30.7.6: 8 a failure; beyond 255 bus-off, BOFF and the error interrupt; with ABOM the controller is back
    after 128 times 11 recessive bits, its counters zero, and sends what waited."""
    body = f"""
        void sce(void) {{ out[0] = out[0] + 1; out[1] = {ESR}; {MSR} = 4; }}
        void reset(void) {{ {normal(1 << 6)} {IER} = 1u << 15 | 1u << 10; REG(0xE000E100u) = 1u << 22; {send(0, 0x123)}
        {SLEEP} }}"""
    memory = build(tmp_path, body, {16 + 22: "sce"})
    soc = Soc(memory)
    soc.can1.damaged_transmissions = 32
    frame_s = frame_bits(8) * 1e-6
    soc.run_for(31.5 * frame_s + 60e-6)
    assert not soc.can1.bus_off
    assert soc.can1.tec == 31 * 8
    assert soc.can1.read_esr() & 7 == 0b011  # warning at 96, passive at 128
    soc.run_for(frame_s)
    count, esr = results(soc, 2)
    assert (count, esr & 7) == (1, 0b111)
    assert soc.can1.sent == []
    soc.run_for(RECOVERY_BITS * 1e-6 + frame_s)
    assert soc.can1.sent == [Frame(0x123, bytes(8))]
    assert soc.can1.read_esr() & 0xFFFF_0007 == 0


def test_without_abom_bus_off_lasts_until_software_asks(tmp_path: Path) -> None:
    """30.7.6: ABOM = 0: software enters and leaves initialisation, then 128 times 11 bits."""
    body = f"void reset(void) {{ {normal()} {send(0, 0x123)} while (!({ESR} & 4)) {{}} {SLEEP} }}"
    soc = Soc(build(tmp_path, body))
    soc.can1.damaged_transmissions = 32
    soc.run_for(0.05)
    assert soc.can1.bus_off
    soc.can1.write_mcr(0x10001)
    soc.can1.write_mcr(0x10000)
    soc.run_for(RECOVERY_BITS * 1e-6 + 2e-4)
    assert not soc.can1.bus_off
    assert len(soc.can1.sent) == 1


def test_alone_on_the_bus_it_goes_error_passive_and_no_further(tmp_path: Path) -> None:
    """ISO 11898-1: a missing acknowledgement does not count beyond error passive; the frame is repeated."""
    body = f"void reset(void) {{ {normal()} {send(0, 0x123)} {SLEEP} }}"
    soc = Soc(build(tmp_path, body))
    soc.can1.acknowledged = False
    soc.run_for(0.05)
    assert soc.can1.tec == 128
    assert soc.can1.read_esr() >> 4 & 7 == 3  # LEC: acknowledgement error
    assert not soc.can1.bus_off
    soc.can1.acknowledged = True
    soc.run_for(1e-3)
    assert len(soc.can1.sent) == 1
    assert soc.can1.tec == 127


def test_bit_timing_only_in_initialisation(tmp_path: Path) -> None:
    with pytest.raises(RuleViolation, match="BTR written outside"):
        run(tmp_path, f"void reset(void) {{ {normal()} {BTR} = 0; for (;;) {{}} }}")


def test_initialisation_needs_sleep_to_be_cleared(tmp_path: Path) -> None:
    """30.4.3: sleep, the state after reset, is left by clearing SLEEP; with SLEEP set there is no INAK."""
    body = f"void reset(void) {{ {CLOCKS} {PINS} {MCR} |= 1; out[0] = {MSR} & 3; {MCR} = 1; out[1] = {MSR} & 3; for (;;) {{}} }}"
    assert results(run(tmp_path, body), 2) == [2, 1]


def test_in_loopback_it_hears_itself_and_in_silence_nobody_else_does(tmp_path: Path) -> None:
    """30.5: LBKM feeds the output back and looks neither for an acknowledge nor at the input; SILM keeps the
    pin recessive."""
    for mode, heard in ((1 << 30, 1), (3 << 30, 0)):
        body = f"""void reset(void) {{ {normal().replace(f"{BTR} = ", f"{BTR} = {mode}u | ")}
            {send(0, 0x100, (0x11, 0x22))} while (({RF0R} & 3u) == 0) {{}} out[0] = {reg(0x1B8)}; {SLEEP} }}"""
        soc = Soc(build(tmp_path, body))
        soc.can1.acknowledged = False
        soc.can1.receive(0x100, b"12345678")
        soc.run_for(0.01)
        assert results(soc, 1) == [0x11]
        assert len(soc.can1.sent) == heard
        assert len(soc.can1.fifos[0]) == 1, "the bus is not heard"
        assert soc.can1.tec == 0
