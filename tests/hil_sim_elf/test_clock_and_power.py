"""RCC, PWR, IWDG, flash wait states: RM0390 chapters 3, 5, 6 and 20."""

from pathlib import Path

import pytest

from hil_sim.board.elf.errors import RuleViolation
from hil_sim.board.elf.soc import Soc
from tests.hil_sim_elf.snippet import build, results, run

RCC_CR, PLLCFGR, CFGR, CIR, CSR = (
    "REG(0x40023800u)",
    "REG(0x40023804u)",
    "REG(0x40023808u)",
    "REG(0x4002380Cu)",
    "REG(0x40023874u)",
)
ACR = "REG(0x40023C00u)"
TIM11 = {"CR1": 0x00, "SR": 0x10, "CCMR1": 0x18, "CCER": 0x20, "CCR1": 0x34, "OR": 0x50}
# 8 MHz / 4 * 180 / 4 = 90 MHz by the formula of 6.3.2; two wait states reach 90 MHz (3.4.1).
PLL_ON = f"""
    {RCC_CR} |= 1u << 16; while (!({RCC_CR} & 1u << 17)) {{}}
    {PLLCFGR} = (8u << 24) | (2u << 28) | (1u << 22) | (1u << 16) | (180u << 6) | 4u;
    REG(0x40023840u) = 1u << 28; REG(0x40007000u) = 1u << 14;
    {RCC_CR} |= 1u << 24; while (!({RCC_CR} & 1u << 25)) {{}}
"""


def test_reset_state(tmp_path: Path) -> None:
    """6.3.1: HSI on and ready, all else off. 6.3.3: HSI is the system clock. 6.3.21: power-on flags."""
    soc = run(
        tmp_path, f"void reset(void) {{ out[0] = {RCC_CR}; out[1] = {CFGR}; out[2] = {CSR}; for (;;) {{}} }}"
    )
    cr, cfgr, csr = results(soc, 3)
    assert (cr & 0x0F0F_0003, cfgr) == (3, 0)
    assert csr == 0x0E00_0000
    assert soc.schedule.frequency == 16e6


def test_hse_becomes_ready_only_after_it_was_switched_on(tmp_path: Path) -> None:
    """6.3.1: HSERDY is set by hardware once the oscillator is stable, and cleared with HSEON."""
    body = f"""
        void reset(void) {{
            out[0] = {RCC_CR} >> 17 & 1; {RCC_CR} |= 1u << 16; out[1] = {RCC_CR} >> 17 & 1;
            while (!({RCC_CR} & 1u << 17)) {{ out[3] = out[3] + 1; }}
            out[2] = 1; {RCC_CR} &= ~(1u << 16); out[4] = {RCC_CR} >> 17 & 1; for (;;) {{}}
        }}"""
    before, at_once, later, polls, off = results(run(tmp_path, body), 5)
    assert (before, at_once, later, off) == (0, 0, 1, 0)
    assert polls > 100


def test_absent_hse_never_becomes_ready(tmp_path: Path) -> None:
    body = f"void reset(void) {{ {RCC_CR} |= 1u << 16; for (;;) {{ out[0] |= {RCC_CR} >> 17 & 1; }} }}"
    soc = Soc(build(tmp_path, body), hse_present=False)
    soc.run_for(0.02)
    assert results(soc, 1) == [0]


def test_pll_frequency_follows_the_formula(tmp_path: Path) -> None:
    body = f"void reset(void) {{ {PLL_ON} {ACR} = 2; {CFGR} = 2u | 4u << 10; out[0] = {CFGR} >> 2 & 3; for (;;) {{}} }}"
    soc = run(tmp_path, body)
    assert results(soc, 1) == [2]
    assert soc.schedule.frequency == 8e6 / 4 * 180 / 4
    assert (soc.rcc.bus_divider(1), soc.rcc.bus_divider(2)) == (2, 1)
    assert soc.rcc.timer_divider(1) == 1  # 6.2: twice PCLK1 when APB1 is divided


@pytest.mark.parametrize(
    ("setup", "rule"),
    [
        (f"{ACR} = 1; {CFGR} = 2u | 4u << 10;", "1 flash wait states"),
        (f"{ACR} = 2; {CFGR} = 2u;", "APB1 above 45 MHz"),
        (f"{PLLCFGR} = 0x24003010u;", "PLLCFGR written while the PLL is on"),
        ("REG(0x40007000u) = 3u << 14;", "VOS written while the PLL is on"),
        (f"{RCC_CR} &= ~1u;", "oscillator of the system clock"),
        (f"{CFGR} = 1u | 3u;", "before it is ready"),
    ],
)
def test_clock_rules(tmp_path: Path, setup: str, rule: str) -> None:
    """3.4.1 (wait states), 6.2 (bus limits), 6.3.1 to 6.3.3 and 5.4.1 (what may change when)."""
    with pytest.raises(RuleViolation, match=rule):
        run(tmp_path, f"void reset(void) {{ {PLL_ON} {setup} for (;;) {{}} }}")


def test_clock_security_falls_back_to_hsi_with_an_nmi(tmp_path: Path) -> None:
    """6.2.7: on failure of HSE the system clock becomes HSI, HSE is disabled, CSSF raises the NMI."""
    body = f"""
        void nmi(void) {{ out[0] = {CIR} >> 7 & 1; {CIR} = 1u << 23; out[1] = {CIR} >> 7 & 1; out[2] = {CFGR} & 0xF; }}
        void reset(void) {{ {PLL_ON} {ACR} = 2; {CFGR} = 2u | 4u << 10; {RCC_CR} |= 1u << 19; out[3] = 5; for (;;) {{}} }}
    """
    soc = run(tmp_path, body, {2: "nmi"})
    assert results(soc, 4) == [0, 0, 0, 5]
    soc.rcc.lose_hse()
    soc.run_for(1e-3)
    assert results(soc, 3) == [1, 0, 0]
    assert soc.schedule.frequency == 16e6


def test_a_gated_peripheral_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RuleViolation, match="TIM2: accessed while its clock is gated"):
        run(tmp_path, "void reset(void) { out[0] = REG(0x40000024u); for (;;) {} }")


@pytest.mark.parametrize(
    ("prescaler", "reload", "seconds"),
    [(0, 0xFFF, 0.512), (3, 2000, 2001 * 32 / 32000), (6, 0x0F, 0.128), (4, 0xFFF, 8.192)],
)
def test_watchdog_resets_after_its_timeout(
    tmp_path: Path, prescaler: int, reload: int, seconds: float
) -> None:
    """20.3, table of timeouts at 32 kHz: /4 and 0xFFF give 512 ms, /64 and 0xFFF 8192 ms."""
    body = f"""
        void reset(void) {{
            if ({CSR} & 1u << 29) {{ out[0] = 1; for (;;) {{ __asm volatile("wfi"); }} }}
            REG(0x40003000u) = 0x5555; REG(0x40003004u) = {prescaler}; REG(0x40003008u) = {reload};
            while (REG(0x4000300Cu)) {{}}
            REG(0x40003000u) = 0xAAAA; REG(0x40003000u) = 0xCCCC;
            for (;;) {{ __asm volatile("wfi"); }}
        }}"""
    soc = run(tmp_path, body, seconds=seconds * 0.99)
    assert soc.resets == []
    soc.run_for(seconds * 0.02)
    assert soc.resets == ["iwdg"]
    assert results(soc, 1) == [1]


def test_refreshed_watchdog_does_not_reset(tmp_path: Path) -> None:
    body = """
        void reset(void) {
            REG(0x40003000u) = 0xCCCC;
            for (;;) {
                REG(0x40003000u) = 0xAAAA;
                for (volatile int i = 0; i < 100000; ++i) { }
            }
        }"""
    assert run(tmp_path, body, seconds=1.0).resets == []


def test_watchdog_registers_are_behind_the_key(tmp_path: Path) -> None:
    """20.3.2: PR and RLR are write-protected until 0x5555."""
    with pytest.raises(RuleViolation, match="0x5555"):
        run(tmp_path, "void reset(void) { REG(0x40003004u) = 1; for (;;) {} }")


@pytest.mark.parametrize("asked", [0, 1 << 18])
@pytest.mark.parametrize("signal", [False, True])
def test_a_clock_signal_needs_the_bypass_and_a_crystal_the_oscillator(
    tmp_path: Path, asked: int, signal: bool
) -> None:
    """6.2.1: an external clock signal requires HSEBYP; a crystal requires it off."""
    body = f"void reset(void) {{ {RCC_CR} |= {asked}u; {RCC_CR} |= 1u << 16; for (;;) {{ out[0] = {RCC_CR} >> 17 & 1; }} }}"
    soc = Soc(build(tmp_path, body), hse_bypass=signal)
    soc.run_for(0.01)
    assert results(soc, 1) == [bool(asked) == signal]


@pytest.mark.parametrize("off", [0.0, 0.01, -0.02])
def test_tim11_counts_the_external_clock_with_the_internal_one(tmp_path: Path, off: float) -> None:
    """6.2.11: 8 MHz / 8 / 8 is a capture every 8 us: 128 counts of 16 MHz, or as the oscillator is off."""
    tim = {name: f"REG(0x{0x4001_4800 + place:08X}u)" for name, place in TIM11.items()}
    body = f"""void reset(void) {{ {RCC_CR} |= 1u << 16; while (!({RCC_CR} & 1u << 17)) {{}}
        {CFGR} = 8u << 16; REG(0x40023844u) = 1u << 18; {tim["OR"]} = 2; {tim["CCMR1"]} = 1u | 3u << 2;
        {tim["CCER"]} = 1; {tim["CR1"]} = 1;
        uint32_t first = 0; for (int n = 0; n < 101; ++n) {{
            while (!({tim["SR"]} & 2u)) {{}} uint32_t at = {tim["CCR1"]}; if (n == 0) first = at;
            out[0] = (at - first) & 0xFFFFu; out[1] |= {tim["SR"]} & 0x200u; }}
        for (volatile int n = 0; n < 1000; ++n) {{}} out[2] = {tim["SR"]} & 0x200u; for (;;) {{}} }}"""
    soc = Soc(build(tmp_path, body))
    soc.hsi_hz = 16e6 * (1 + off)
    soc.request_reset("pin")
    soc.run_for(0.01)
    counts, missed, missed_later = results(soc, 3)
    assert abs(counts - 12800 * (1 + off)) <= 1
    assert (missed, missed_later) == (0, 0x200)
