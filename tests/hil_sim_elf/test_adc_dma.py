"""ADC and DMA: RM0390 chapters 13 and 9."""

from pathlib import Path

import pytest

from hil_sim.board.elf.errors import RuleViolation, UnmodelledAccess
from hil_sim.board.elf.soc import Soc
from tests.hil_sim_elf.snippet import build, results, run

CLOCKS = "REG(0x40023830u) = 3u << 21 | 7u; REG(0x40023840u) = 0xFu; REG(0x40023844u) = 3u << 8;"
# DMA2 stream 0, channel 0 (ADC1): words from CDR to RAM, circular, HT and TC interrupts.
S0 = 0x4002_6410
DMA = "REG(0x40026418u) = 0x40012308u; REG(0x4002641Cu) = 0x20002000u; REG(0x40026414u) = {count}u;"
CIRCULAR = 1 << 8 | 1 << 10 | 2 << 11 | 2 << 13 | 3 << 16
DUAL = "REG(0x40012304u) = 6u | 1u << 13 | 2u << 14 | 1u << 16;"
ADCS = """REG(0x40012034u) = 10; REG(0x40012134u) = 11; REG(0x40012008u) = 1u | 8u << 24 | 1u << 28;
          REG(0x40012108u) = 1u;"""
TIM3_10KHZ = "REG(0x4000042Cu) = 1599; REG(0x40000404u) = 2u << 4; REG(0x40000400u) = 1;"
IRQ56 = "REG(0xE000E104u) = 1u << 24;"
HANDLER = """
    void dma(void) {
        uint32_t flags = REG(0x40026400u);
        out[1 + (out[0] & 7)] = flags; out[0] = out[0] + 1; REG(0x40026408u) = flags;
    }
"""
SLEEP = 'for (;;) { __asm volatile("wfi"); }'


def test_dual_simultaneous_conversions_reach_the_ring_with_both_flags(tmp_path: Path) -> None:
    """13.9: both convert at one trigger, and CDR holds ADC2 << 16 | ADC1 (DMA mode 2).
    9.3.8, 9.5.1: HTIF after half the items, TCIF after all of them, then the ring begins again."""
    body = f"""{HANDLER}
        void reset(void) {{ {CLOCKS} {DMA.format(count=8)} REG(0x{S0:X}u) = {CIRCULAR | 3 << 3 | 1}u; {IRQ56}
            {DUAL} {ADCS} {TIM3_10KHZ} {SLEEP} }}"""
    soc = Soc(build(tmp_path, body, {16 + 56: "dma"}))
    calls: list[tuple[int, int]] = []

    def source(channel: int) -> int:
        calls.append((channel, soc.schedule.now))
        return len(calls) // 2 if channel == 10 else 0x800 + len(calls) // 2 - 1

    soc.adc.source = source
    soc.run_for(0.00205)  # twenty triggers
    assert [channel for channel, _ in calls] == [10, 11] * 20
    assert all(a[1] == b[1] for a, b in zip(calls[::2], calls[1::2], strict=True))
    assert {b[1] - a[1] for a, b in zip(calls[::2], calls[2::2], strict=False)} == {1600}
    half, full = 1 << 4, 1 << 5
    assert results(soc, 6) == [5, half, full, half, full, half]
    ring = [int.from_bytes(soc.memory.read_bytes(0x2000_2000 + 4 * n, 4), "little") for n in range(8)]
    assert ring == [0x800 + k << 16 | k for k in (16, 17, 18, 19, 12, 13, 14, 15)]


def test_conversion_time(tmp_path: Path) -> None:
    """13.5: sampling time plus 12 cycles of the ADC clock, here (480 + 12) * 2 at PCLK2 / 2."""
    body = f"""void reset(void) {{ {CLOCKS} REG(0x40012034u) = 17; REG(0x4001200Cu) = 7u << 21; REG(0x40012304u) = 1u << 23;
        REG(0x40012008u) = 1; REG(0x40012008u) = 1u | 1u << 30;
        while (!(REG(0x40012000u) & 2)) {{}} out[0] = REG(0x4001204Cu); out[1] = REG(0x40012000u) & 2; for (;;) {{}} }}"""
    soc = Soc(build(tmp_path, body))
    times: list[int] = []

    def source(channel: int) -> int:
        times.append(soc.schedule.now)
        return channel * 100

    soc.adc.source = source
    while not times:
        soc.run_for(1e-6)
    while not soc.adc.adc1.value["SR"] & 2 and not results(soc, 1)[0]:
        soc.run_until(soc.clock.cycles + 4)
    assert soc.clock.cycles - times[0] == pytest.approx(492 * 2, abs=12)
    soc.run_for(1e-4)
    assert results(soc, 2) == [1700, 0]  # reading DR clears EOC (13.13.1)


def test_overrun_stops_the_requests(tmp_path: Path) -> None:
    """13.8.2: a result that the DMA did not take in time sets OVR, and no further requests are made."""
    body = f"""
        void adc(void) {{ out[0] = out[0] + 1; REG(0x40012004u) = 0; }}
        void reset(void) {{ {CLOCKS} {DMA.format(count=3)} REG(0x{S0:X}u) = {CIRCULAR & ~(1 << 8) | 1}u;
            REG(0xE000E100u) = 1u << 18; REG(0x40012004u) = 1u << 26;
            {DUAL} {ADCS} {TIM3_10KHZ} {SLEEP} }}"""
    soc = run(tmp_path, body, {16 + 18: "adc"}, seconds=0.002)
    assert results(soc, 1) == [1]
    assert soc.adc.adc1.value["SR"] & 1 << 5
    assert soc.dmas["DMA2"].streams[0].value["NDTR"] == 0
    assert not soc.dmas["DMA2"].streams[0].enabled


def test_double_buffer_switches_target(tmp_path: Path) -> None:
    """9.3.10: CT toggles at each end, and the next items go to the other memory area."""
    body = f"""void reset(void) {{ {CLOCKS} {DMA.format(count=4)} REG(0x40026420u) = 0x20003000u;
        REG(0x{S0:X}u) = {CIRCULAR | 1 << 18 | 1}u; {DUAL} {ADCS} {TIM3_10KHZ} {SLEEP} }}"""
    soc = Soc(build(tmp_path, body))
    count = 0

    def source(channel: int) -> int:
        nonlocal count
        count += channel == 10
        return count if channel == 10 else 0

    soc.adc.source = source
    soc.run_for(0.00065)  # six conversions
    words = [
        int.from_bytes(soc.memory.read_bytes(base + 4 * n, 4), "little")
        for base in (0x2000_2000, 0x2000_3000)
        for n in range(4)
    ]
    assert words == [1, 2, 3, 4, 5, 6, 0, 0]
    assert soc.dmas["DMA2"].streams[0].value["CR"] & 1 << 19


def test_transfer_to_nowhere_is_a_transfer_error(tmp_path: Path) -> None:
    """9.3.18: a bus error sets TEIF and disables the stream."""
    body = f"""void reset(void) {{ {CLOCKS} {DMA.format(count=4)} REG(0x4002641Cu) = 0x30000000u;
        REG(0x{S0:X}u) = {CIRCULAR | 1}u; {DUAL} {ADCS} {TIM3_10KHZ} {SLEEP} }}"""
    stream = run(tmp_path, body, seconds=0.0005).dmas["DMA2"].streams[0]
    assert (stream.flags, stream.enabled) == (1 << 3, False)


@pytest.mark.parametrize(
    ("statement", "rule"),
    [
        (f"REG(0x{S0:X}u) = {CIRCULAR | 1}u; REG(0x40026414u) = 5;", "written while the stream is enabled"),
        (f"REG(0x{S0:X}u) = {CIRCULAR | 1}u; REG(0x{S0:X}u) = 1u;", "configured while enabled"),
        (f"REG(0x40026414u) = 0; REG(0x{S0:X}u) = {CIRCULAR | 1}u;", "nothing to transfer"),
        (f"REG(0x{S0:X}u) = {(CIRCULAR & ~(3 << 13)) | 1}u;", "MSIZE differs"),
        (
            f"REG(0x{S0:X}u) = {CIRCULAR | 1}u; REG(0x{S0:X}u) = {CIRCULAR}u; REG(0x{S0:X}u) = {CIRCULAR | 1}u;",
            "flags",
        ),
    ],
)
def test_dma_rules(tmp_path: Path, statement: str, rule: str) -> None:
    """9.5.5, 9.5.6, 9.3.12, 9.3.17: what may not be written while enabled, and what must hold before."""
    with pytest.raises(RuleViolation, match=rule):
        run(tmp_path, f"void reset(void) {{ {CLOCKS} {DMA.format(count=4)} {statement} for (;;) {{}} }}")


def test_fifo_mode_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UnmodelledAccess, match="DMA2_S0FCR at 0x40026424, bits 0x00000004"):
        run(tmp_path, f"void reset(void) {{ {CLOCKS} REG(0x40026424u) = 0x24; for (;;) {{}} }}")


@pytest.mark.parametrize(("dds", "moved"), [(1 << 13, 20), (0, 8)])
def test_requests_end_with_the_block_unless_dds_is_set(tmp_path: Path, dds: int, moved: int) -> None:
    """13.8.1, 13.13.16: with DDS = 0 no request follows the DMA's last transfer, circular or not, and no overrun."""
    dual = DUAL.replace("1u << 13", f"{dds}u")
    body = f"""void reset(void) {{ {CLOCKS} {DMA.format(count=8)} REG(0x{S0:X}u) = {CIRCULAR | 1}u;
        {dual} {ADCS} {TIM3_10KHZ} {SLEEP} }}"""
    soc = Soc(build(tmp_path, body))
    count = 0

    def source(channel: int) -> int:
        nonlocal count
        count += channel == 10
        return count

    soc.adc.source = source
    soc.run_for(0.00205)  # twenty triggers
    ring = [
        int.from_bytes(soc.memory.read_bytes(0x2000_2000 + 4 * n, 4), "little") & 0xFFFF for n in range(8)
    ]
    assert (count, max(ring)) == (20, moved)
    assert not soc.adc.adc1.value["SR"] & 1 << 5


@pytest.mark.parametrize(
    ("common", "sampling", "rule"), [(0, 7, "TSVREFE is 0"), (1 << 23, 1, "less than 10 us")]
)
def test_the_internal_reference_needs_its_switch_and_its_time(
    tmp_path: Path, common: int, sampling: int, rule: str
) -> None:
    """13.10: TSVREFE enables both internal channels; data sheet: they are sampled for 10 us or more."""
    body = f"""void reset(void) {{ {CLOCKS} REG(0x40012034u) = 17; REG(0x4001200Cu) = {sampling}u << 21;
        REG(0x40012304u) = {common}u; REG(0x40012008u) = 1; REG(0x40012008u) = 1u | 1u << 30; for (;;) {{}} }}"""
    with pytest.raises(RuleViolation, match=rule):
        run(tmp_path, body)


def test_an_injected_conversion_on_software_leaves_its_result_in_jdr1(tmp_path: Path) -> None:
    """13.3.9, 13.13.12: JL = 0 converts JSQ4; in regular and injected simultaneous mode both converters do."""
    body = f"""void reset(void) {{ {CLOCKS} {DUAL.replace("6u |", "1u |")} {ADCS}
        REG(0x40012038u) = 12u << 15; REG(0x40012138u) = 13u << 15; REG(0x40012008u) |= 1u << 22;
        while (!(REG(0x40012000u) & 4)) {{}} out[0] = REG(0x4001203Cu); out[1] = REG(0x4001213Cu);
        REG(0x40012000u) = ~4u; out[2] = REG(0x40012000u) & 4; for (;;) {{}} }}"""
    soc = Soc(build(tmp_path, body))
    soc.adc.source = lambda channel: 100 * channel
    soc.run_for(1e-4)
    assert results(soc, 3) == [1200, 1300, 0]


def test_an_injected_conversion_needs_its_mode(tmp_path: Path) -> None:
    """13.9.2: regular simultaneous mode alone leaves injected conversions out."""
    body = f"void reset(void) {{ {CLOCKS} {DUAL} {ADCS} REG(0x40012008u) |= 1u << 22; for (;;) {{}} }}"
    with pytest.raises(RuleViolation, match="regular simultaneous mode"):
        run(tmp_path, body)
