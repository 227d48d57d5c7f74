"""Timers: RM0390 chapters 17 and 18."""

from pathlib import Path

import pytest

from hil_sim.board.elf.errors import UnmodelledAccess
from hil_sim.board.elf.soc import Soc
from tests.hil_sim_elf.snippet import build, results, run

ENABLE = "REG(0x40023840u) = 0x4Fu;"  # TIM2 to TIM5, TIM12
TIM2, TIM3, TIM4, TIM5, TIM12 = 0x4000_0000, 0x4000_0400, 0x4000_0800, 0x4000_0C00, 0x4000_1800
CR1, CR2, SMCR, DIER, SR, EGR, CCMR1, CCMR2, CCER, CNT, PSC, ARR, CCR1, CCR3 = (
    0x00, 0x04, 0x08, 0x0C, 0x10, 0x14, 0x18, 0x1C, 0x20, 0x24, 0x28, 0x2C, 0x34, 0x3C,
)  # fmt: skip


def reg(timer: int, offset: int) -> str:
    return f"REG(0x{timer + offset:08X}u)"


@pytest.mark.parametrize(("prescaler", "top"), [(0, 15999), (15, 999), (1599, 9)])
def test_update_period_is_psc_plus_one_times_arr_plus_one(tmp_path: Path, prescaler: int, top: int) -> None:
    """17.3.2: each of these makes 1 kHz from 16 MHz; UIF and the interrupt come at every update."""
    soc = run(
        tmp_path,
        f"""
        void update(void) {{ {reg(TIM3, SR)} = ~1u; out[0] = out[0] + 1; }}
        void reset(void) {{
            {ENABLE} {reg(TIM3, PSC)} = {prescaler}; {reg(TIM3, ARR)} = {top}; {reg(TIM3, EGR)} = 1;
            {reg(TIM3, SR)} = 0; {reg(TIM3, DIER)} = 1; REG(0xE000E100u) = 1u << 29; {reg(TIM3, CR1)} = 1;
            for (;;) {{ __asm volatile("wfi"); }}
        }}""",
        {16 + 29: "update"},
        seconds=0.1002,
    )
    assert results(soc, 1) == [100]


def test_prescaler_is_taken_over_at_the_update(tmp_path: Path) -> None:
    """17.4.11: PSC is buffered; without an update event the old value goes on."""
    body = f"void reset(void) {{ {ENABLE} {reg(TIM3, PSC)} = 1599; {reg(TIM3, CR1)} = 1; for (;;) {{}} }}"
    soc = run(tmp_path, body, seconds=1e-3)
    assert soc.timers["TIM3"].count() > 15_000  # undivided


def test_arr_preload(tmp_path: Path) -> None:
    """17.3.1: with ARPE a new ARR waits for the update; without, it works at once."""
    body = f"""void reset(void) {{ {ENABLE} {reg(TIM3, CR1)} = {{arpe}}; {reg(TIM3, ARR)} = 99; {reg(TIM3, CR1)} |= 1;
               for (;;) {{}} }}"""
    with_preload = run(tmp_path, body.replace("{arpe}", "1u << 7"), seconds=1e-3)
    assert with_preload.timers["TIM3"].count() > 10_000
    without = run(tmp_path, body.replace("{arpe}", "0"), seconds=1e-3)
    assert without.timers["TIM3"].count() <= 99


def test_widths(tmp_path: Path) -> None:
    """17.2: TIM2 and TIM5 have 32 bits, TIM3 and TIM4 have 16."""
    body = f"""void reset(void) {{ {ENABLE} {reg(TIM2, CNT)} = 0xFFFFFFFFu; {reg(TIM3, CNT)} = 0xFFFFFFFFu;
               out[0] = {reg(TIM2, CNT)}; out[1] = {reg(TIM3, CNT)}; out[2] = {reg(TIM5, ARR)};
               out[3] = {reg(TIM4, ARR)}; for (;;) {{}} }}"""
    assert results(run(tmp_path, body), 4) == [0xFFFF_FFFF, 0xFFFF, 0xFFFF_FFFF, 0xFFFF]


@pytest.mark.parametrize(
    ("mode", "inverted", "per_period"),
    [(3, 0, 4), (3, 2, -4), (1, 0, 2), (2, 0, 2), (2, 2, -2)],
)
def test_encoder_counting_table(tmp_path: Path, mode: int, inverted: int, per_period: int) -> None:
    """17.3.12: TI1 leading TI2 counts up; mode 3 counts every edge, modes 1 and 2 those of one input."""
    body = f"""void reset(void) {{ {ENABLE} {reg(TIM2, CCMR1)} = 0x0101; {reg(TIM2, CCER)} = {inverted};
               {reg(TIM2, SMCR)} = {mode}; {reg(TIM2, CNT)} = 1000; {reg(TIM2, CR1)} = 1; for (;;) {{}} }}"""
    timer = run(tmp_path, body).timers["TIM2"]
    period = [(1, True), (2, True), (1, False), (2, False)]
    for channel, level in period:
        timer.edge(channel, level)
    assert timer.count() == 1000 + per_period
    for channel, level in reversed(period):
        timer.edge(channel, not level)
    assert timer.count() == 1000
    assert bool(timer.read_cr1() & 1 << 4) == (per_period > 0)  # DIR: it last turned the other way


def test_encoder_jitter_on_one_input_cancels(tmp_path: Path) -> None:
    """17.3.12: an input that toggles while the other rests counts up and down alike."""
    body = f"""void reset(void) {{ {ENABLE} {reg(TIM2, CCMR1)} = 0x0101; {reg(TIM2, SMCR)} = 3; {reg(TIM2, CR1)} = 1;
               for (;;) {{}} }}"""
    timer = run(tmp_path, body).timers["TIM2"]
    for _ in range(7):
        timer.edge(1, True)
        timer.edge(1, False)
    assert timer.count() == 0


@pytest.mark.parametrize(("start", "moved", "end"), [(5, -10, 0xFFFF_FFFB), (0xFFFF_FFF0, 32, 16)])
def test_encoder_wraps_at_32_bits(tmp_path: Path, start: int, moved: int, end: int) -> None:
    """17.3.12: the counter runs between 0 and ARR, and passing an end is an update."""
    body = f"""void reset(void) {{ {ENABLE} {reg(TIM5, CCMR1)} = 0x0101; {reg(TIM5, SMCR)} = 3; {reg(TIM5, CNT)} = {start}u;
               {reg(TIM5, CR1)} = 1; for (;;) {{}} }}"""
    soc = Soc(build(tmp_path, body))
    timer = soc.timers["TIM5"]
    place = 0
    timer.position = lambda: place
    soc.run_for(1e-3)
    place = moved
    assert timer.count() == end
    assert timer.read_sr() & 1


def test_trigger_chain_starts_captures_and_counts(tmp_path: Path) -> None:
    """17.3.13 to 17.3.15: TIM4's update (UG too) is TRGO; it starts TIM3 (trigger mode, ITR3) and clocks TIM12
    (external clock mode 1, ITR0); TIM3's update captures TIM2 through TRC (ITR2, CC3S = 11)."""
    body = f"""void reset(void) {{ {ENABLE}
        {reg(TIM4, ARR)} = 1599; {reg(TIM4, CR2)} = 2u << 4;
        {reg(TIM12, SMCR)} = 7u; {reg(TIM12, CR1)} = 1;
        {reg(TIM3, ARR)} = 159; {reg(TIM3, CR2)} = 2u << 4; {reg(TIM3, SMCR)} = 3u << 4; {reg(TIM3, SMCR)} = 3u << 4 | 6u;
        {reg(TIM2, SMCR)} = 2u << 4; {reg(TIM2, CCMR2)} = 3; {reg(TIM2, CCER)} = 1u << 8; {reg(TIM2, CR1)} = 1;
        out[0] = {reg(TIM3, CR1)} & 1; {reg(TIM4, CR1)} = 1; {reg(TIM4, EGR)} = 1; out[1] = {reg(TIM3, CR1)} & 1;
        for (;;) {{ __asm volatile("wfi"); }} }}"""
    soc = run(tmp_path, body, seconds=1.05e-3)
    assert results(soc, 2) == [0, 1]
    # 1.05 ms: UG and ten updates of TIM4 (a tenth of a millisecond each).
    assert soc.timers["TIM12"].count() == 11
    tim2 = soc.timers["TIM2"]
    captured = tim2.value["CCR3"]
    now = tim2.count()
    assert 0 <= now - captured <= 160
    assert tim2.value["SR"] & 1 << 3
    assert tim2.value["SR"] & 1 << 11  # CC3OF: nobody read the earlier captures
    assert tim2.read_ccr3() == captured
    assert not tim2.value["SR"] & 1 << 3  # 17.4.5: reading CCR3 clears CC3IF
    assert tim2.value["SR"] & 1 << 11


def test_input_capture_latches_the_counter(tmp_path: Path) -> None:
    """17.3.6: a rising edge on TI1 copies CNT to CCR1 and sets CC1IF; a falling one does nothing."""
    body = f"""void reset(void) {{ {ENABLE} {reg(TIM4, PSC)} = 15; {reg(TIM4, EGR)} = 1; {reg(TIM4, CCMR1)} = 0x31;
               {reg(TIM4, CCER)} = 1; {reg(TIM4, SR)} = 0; {reg(TIM4, CR1)} = 1; for (;;) {{ __asm volatile("wfi"); }} }}"""
    soc = run(tmp_path, body, seconds=2e-3)
    timer = soc.timers["TIM4"]
    timer.edge(1, False)
    assert not timer.read_sr() & 2
    timer.edge(1, True)
    assert timer.read_sr() & 2
    assert timer.read_ccr1() == pytest.approx(2000, abs=10)
    assert not timer.read_sr() & 2


def test_compare_output_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UnmodelledAccess, match="TIM3_CCMR1"):
        run(tmp_path, f"void reset(void) {{ {ENABLE} {reg(TIM3, CCMR1)} = 0x60; for (;;) {{}} }}")


@pytest.mark.parametrize(
    ("code", "swallowed_ns"),
    # Readings at fDTS = 16 MHz, 62.5 ns: none; 8; 6 at fDTS / 2; 8 at fDTS / 32.
    [(0, 0), (3, 500), (4, 750), (15, 16_000)],
)
def test_input_filter_swallows_short_pulses(tmp_path: Path, code: int, swallowed_ns: int) -> None:
    """17.4.7 ICxF: so many equal readings at that rate make an edge."""
    body = f"""void reset(void) {{ {ENABLE} {reg(TIM4, CCMR1)} = {1 | code << 4}; {reg(TIM4, CCER)} = 1;
               {reg(TIM4, CR1)} = 1; for (;;) {{ __asm volatile("wfi"); }} }}"""
    soc = run(tmp_path, body, seconds=1e-4)
    timer = soc.timers["TIM4"]
    timer.pulse(1, (swallowed_ns - 10) * 1e-9)
    soc.run_for(1e-4)
    assert not timer.read_sr() & 2
    timer.pulse(1, (swallowed_ns + 10) * 1e-9)
    soc.run_for(1e-4)
    assert timer.read_sr() & 2


def test_an_output_toggles_at_each_match_and_can_be_held_low(tmp_path: Path) -> None:
    """17.3.9, OC1M 011 and 100: 16 MHz / 1000 is a match every 62.5 us, 300 clocks behind the update."""
    body = f"""void reset(void) {{ {ENABLE} {reg(TIM3, ARR)} = 999; {reg(TIM3, EGR)} = 1; {reg(TIM3, CCER)} = 1;
        {reg(TIM3, CR1)} = 1; {reg(TIM3, CCMR1)} = 4u << 4; {reg(TIM3, CCR1)} = 300; {reg(TIM3, CCMR1)} = 3u << 4;
        for (;;) {{ if (out[0]) {reg(TIM3, CCMR1)} = 4u << 4; }} }}"""
    soc = run(tmp_path, body, seconds=1e-3)
    timer = soc.timers["TIM3"]
    update = timer.next_update()
    assert update is not None
    before = timer.output.level(update + 299)
    levels = [timer.output.level(update + 300 + 1000 * n + k) for n in range(3) for k in (0, 999)]
    assert levels == [not before, not before, before, before, not before, not before]
    soc.memory.ram[0x1000] = 1
    soc.run_for(1e-3)
    assert not any(timer.output.level(soc.schedule.now + 500 * n) for n in range(4))


def test_other_output_modes_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UnmodelledAccess, match="CCMR1"):
        run(tmp_path, f"void reset(void) {{ {ENABLE} {reg(TIM3, CR1)} = 1; {reg(TIM3, CCMR1)} = 6u << 4; }}")
