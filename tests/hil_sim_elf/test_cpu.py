"""Exception frames, EXC_RETURN, preemption, tail-chaining, masks and sleep, as PM0214 states them."""

import struct
from pathlib import Path

import pytest

from hil_sim.board.elf.errors import CpuFault, UnmodelledAccess
from hil_sim.board.elf.soc import Soc
from tests.hil_sim_elf.snippet import STACK_TOP, build, results, run

ISER0, ISPR0, IPR = "0xE000E100u", "0xE000E200u", "0xE000E400u"


def test_basic_frame_and_exc_return(tmp_path: Path) -> None:
    """PM0214 2.3.7: R0-R3, R12, LR, PC, xPSR are pushed, LR becomes 0xFFFFFFF9, SP comes back."""
    soc = run(
        tmp_path,
        """
        __attribute__((naked)) void handler(void) {
            __asm volatile(
                "ldr r0, =0x20001000\\n str lr, [r0]\\n mov r1, sp\\n str r1, [r0, #4]\\n"
                "mrs r2, ipsr\\n str r2, [r0, #8]\\n"
                "ldmia sp, {r2, r3}\\n str r2, [r0, #12]\\n str r3, [r0, #16]\\n"
                "ldr r2, [sp, #16]\\n str r2, [r0, #20]\\n"
                "movs r2, #99\\n movs r3, #98\\n mov r12, r2\\n bx lr");
        }
        __attribute__((naked)) void reset(void) {
            __asm volatile(
                "ldr r0, =0xE000E100\\n movs r1, #32\\n mov r12, r1\\n movs r2, #22\\n movs r3, #33\\n"
                "str r1, [r0]\\n str r1, [r0, #0x100]\\n nop\\n b 1f\\n 1: nop\\n"
                "ldr r4, =0x20001000\\n str r2, [r4, #24]\\n str r3, [r4, #28]\\n str r12, [r4, #32]\\n"
                "mov r5, sp\\n str r5, [r4, #36]\\n b .");
        }
        """,
        {16 + 5: "handler"},
    )
    lr, sp, ipsr, r0, r1, r12, after2, after3, after12, after_sp = results(soc, 10)
    assert lr == 0xFFFF_FFF9
    assert sp == STACK_TOP - 32
    assert ipsr == 16 + 5
    assert (r0, r1, r12) == (0xE000_E100, 32, 32)
    assert (after2, after3, after12, after_sp) == (22, 33, 32, STACK_TOP)


def test_floating_point_context_survives_a_handler_that_uses_it(tmp_path: Path) -> None:
    """PM0214 2.3.7: with CONTROL.FPCA the frame is extended, EXC_RETURN is 0xFFFFFFE9, S0-S15 come back."""
    soc = run(
        tmp_path,
        """
        volatile float dummy __attribute__((section(".bss")));
        __attribute__((naked)) void handler(void) {
            __asm volatile(
                "ldr r0, =0x20001000\\n str lr, [r0]\\n mov r1, sp\\n str r1, [r0, #4]\\n"
                "mrs r1, control\\n str r1, [r0, #16]\\n"
                "movs r1, #0\\n vmov s0, r1\\n vmov s15, r1\\n vadd.f32 s0, s0, s0\\n bx lr");
        }
        __attribute__((naked)) void reset(void) {
            __asm volatile(
                "ldr r0, =0xE000ED88\\n ldr r1, =0x00F00000\\n str r1, [r0]\\n b 1f\\n 1:\\n"
                "ldr r6, =0x3FC00000\\n vmov s0, r6\\n vmov s15, r6\\n"
                "ldr r0, =0xE000E100\\n movs r1, #32\\n str r1, [r0]\\n str r1, [r0, #0x100]\\n b 2f\\n 2: nop\\n"
                "ldr r4, =0x20001000\\n vmov r5, s0\\n str r5, [r4, #8]\\n vmov r5, s15\\n str r5, [r4, #12]\\n"
                "mrs r5, control\\n str r5, [r4, #20]\\n b .");
        }
        """,
        {16 + 5: "handler"},
    )
    lr, sp, s0, s15, control_in_handler, control_after = results(soc, 6)
    assert lr == 0xFFFF_FFE9
    assert sp == STACK_TOP - 0x68
    assert [struct.unpack("<f", word.to_bytes(4, "little"))[0] for word in (s0, s15)] == [1.5, 1.5]
    assert not control_in_handler & 4
    assert control_after & 4


def test_stack_is_aligned_to_eight_bytes(tmp_path: Path) -> None:
    """PM0214 4.4.7 STKALIGN: an odd word of stack is skipped on entry and given back on return."""
    soc = run(
        tmp_path,
        """
        __attribute__((naked)) void handler(void) {
            __asm volatile("ldr r0, =0x20001000\\n mov r1, sp\\n str r1, [r0]\\n ldr r1, [sp, #28]\\n"
                           "str r1, [r0, #4]\\n bx lr");
        }
        __attribute__((naked)) void reset(void) {
            __asm volatile("sub sp, #4\\n ldr r0, =0xE000E100\\n movs r1, #32\\n str r1, [r0]\\n"
                           "str r1, [r0, #0x100]\\n b 2f\\n 2: ldr r4, =0x20001000\\n mov r5, sp\\n"
                           "str r5, [r4, #8]\\n b .");
        }
        """,
        {16 + 5: "handler"},
    )
    in_handler, xpsr, after = results(soc, 3)
    assert in_handler == STACK_TOP - 4 - 4 - 32
    assert xpsr & 1 << 9
    assert after == STACK_TOP - 4


ORDER = """
static void note(uint32_t what) { out[1 + out[0]] = what; out[0] = out[0] + 1; }
static uint32_t ipsr(void) { uint32_t v; __asm volatile("mrs %0, ipsr" : "=r"(v)); return v; }
"""


def test_more_urgent_interrupt_preempts_and_equal_one_waits(tmp_path: Path) -> None:
    """PM0214 2.3.6: a lower number preempts; equal priorities do not; ties go to the lower number."""
    soc = run(
        tmp_path,
        ORDER
        + f"""
        void low(void) {{
            note(10); REG({ISPR0}) = 1u << 7; note(11); REG({ISPR0}) = 1u << 6; note(12);
        }}
        void equal(void) {{ note(20); }}
        void high(void) {{ note(30 + ipsr()); }}
        void reset(void) {{
            out[0] = 0;
            BYTE({IPR} + 5) = 0x40; BYTE({IPR} + 6) = 0x30; BYTE({IPR} + 7) = 0x40;
            REG({ISER0}) = 7u << 5;
            REG({ISPR0}) = 1u << 5;
            note(40);
            for (;;) {{ }}
        }}
        """,
        {16 + 5: "low", 16 + 6: "high", 16 + 7: "equal"},
    )
    count, *rest = results(soc, 8)
    assert rest[:count] == [10, 11, 30 + 22, 12, 20, 40]
    assert not soc.nvic.active


def test_tail_chaining_keeps_the_frame(tmp_path: Path) -> None:
    """PM0214 2.3.7: the second handler finds the same frame and the same EXC_RETURN."""
    soc = run(
        tmp_path,
        f"""
        __attribute__((naked)) void first(void) {{
            __asm volatile("ldr r0, =0x20001000\\n mov r1, sp\\n str r1, [r0]\\n bx lr");
        }}
        __attribute__((naked)) void second(void) {{
            __asm volatile("ldr r0, =0x20001000\\n mov r1, sp\\n str r1, [r0, #4]\\n str lr, [r0, #8]\\n bx lr");
        }}
        void reset(void) {{
            __asm volatile("cpsid i");
            REG({ISER0}) = 3u << 5; REG({ISPR0}) = 3u << 5;
            __asm volatile("cpsie i");
            out[3] = 7; for (;;) {{ }}
        }}
        """,
        {16 + 5: "first", 16 + 6: "second"},
    )
    sp1, sp2, lr, done = results(soc, 4)
    assert sp1 == sp2
    assert lr == 0xFFFF_FFF9
    assert done == 7


@pytest.mark.parametrize(("mask", "seen"), [("cpsid i", 0), ("msr basepri, %0", 0), ("nop", 1)])
def test_masks_hold_interrupts_back(tmp_path: Path, mask: str, seen: int) -> None:
    """PM0214 2.1.3: PRIMASK masks all, BASEPRI those of the same or a lower priority; then they enter."""
    soc = run(
        tmp_path,
        f"""
        void handler(void) {{ out[0] = 1; }}
        void reset(void) {{
            BYTE({IPR} + 5) = 0x40;
            __asm volatile("{mask}" ::"r"(0x40));
            REG({ISER0}) = 1u << 5; REG({ISPR0}) = 1u << 5;
            for (volatile int i = 0; i < 10; ++i) {{ }}
            out[1] = out[0];
            __asm volatile("cpsie i\\n msr basepri, %0" ::"r"(0));
            for (volatile int i = 0; i < 10; ++i) {{ }}
            out[2] = out[0];
            for (;;) {{ }}
        }}
        """,
        {16 + 5: "handler"},
    )
    assert results(soc, 3)[1:] == [seen, 1]


def test_wfi_with_primask_wakes_without_entering(tmp_path: Path) -> None:
    """PM0214 2.5.3: PRIMASK does not keep WFI asleep; the handler runs when PRIMASK is cleared."""
    soc = run(
        tmp_path,
        """
        void tick(void) { out[0] = out[0] + 1; }
        void reset(void) {
            __asm volatile("cpsid i");
            REG(0xE000E014u) = 15999; REG(0xE000E018u) = 0; REG(0xE000E010u) = 7;
            __asm volatile("wfi");
            out[1] = out[0];
            REG(0xE000E010u) = 0;
            __asm volatile("cpsie i\\n nop");
            out[2] = out[0];
            for (;;) { __asm volatile("wfi"); }
        }
        """,
        {15: "tick"},
        seconds=0.005,
    )
    assert results(soc, 3) == [1, 0, 1]
    assert soc.clock.instructions < 100  # it slept, rather than spinning


def test_systick_period_is_reload_plus_one(tmp_path: Path) -> None:
    """PM0214 4.5.2: RELOAD = N - 1 gives a period of N cycles, here 1 ms at 16 MHz."""
    soc = run(
        tmp_path,
        """
        void tick(void) { out[0] = out[0] + 1; }
        void reset(void) {
            REG(0xE000E014u) = 15999; REG(0xE000E018u) = 0; REG(0xE000E010u) = 7;
            for (;;) { __asm volatile("wfi"); }
        }
        """,
        {15: "tick"},
        seconds=0.1005,
    )
    assert results(soc, 1) == [100]


def test_software_reset_keeps_the_ram_and_says_so(tmp_path: Path) -> None:
    """PM0214 4.4.5 SYSRESETREQ; RM0390 6.3.21: SFTRSTF and PINRSTF are set, RMVF clears them."""
    soc = run(
        tmp_path,
        """
        void reset(void) {
            out[out[0] + 1] = REG(0x40023874u); REG(0x40023874u) = 1u << 24; out[4] = REG(0x40023874u);
            out[0] = out[0] + 1;
            if (out[0] == 1) { REG(0xE000ED0Cu) = 0x05FA0004u; }
            for (;;) { }
        }
        """,
    )
    boots, first, second, _, cleared = results(soc, 5)
    assert boots == 2
    assert first >> 25 == 0b0000111
    assert second >> 25 == 0b0001010
    assert cleared >> 25 == 0
    assert soc.resets == ["software"]


def test_aircr_needs_its_key(tmp_path: Path) -> None:
    """PM0214 4.4.5: without VECTKEY the write is ignored."""
    assert run(tmp_path, "void reset(void) { REG(0xE000ED0Cu) = 0x12340004u; for (;;) {} }").resets == []


@pytest.mark.parametrize(
    ("statement", "match"),
    [
        ("REG(0x40012C00u) = 1;", "0x40012C00"),  # TIM1
        ("REG(0x40023800u) |= 1u << 26;", "RCC_CR at 0x40023800, bits 0x04000000"),  # PLLI2SON
        ("REG(0xE000ED10u) = 4;", "SCB_SCR at 0xE000ED10, bits 0x00000004"),  # SLEEPDEEP
        ("BYTE(0x40023800u) = 1;", "RCC"),  # byte access to a word register
    ],
)
def test_what_is_not_modelled_is_refused(tmp_path: Path, statement: str, match: str) -> None:
    with pytest.raises(UnmodelledAccess, match=match) as caught:
        run(tmp_path, f"void reset(void) {{ {statement} for (;;) {{}} }}")
    assert 0x0800_0000 <= caught.value.pc < 0x0800_1000


def test_access_to_nothing_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CpuFault, match="0x1FFFFFFC"):
        run(tmp_path, "void reset(void) { REG(0x1FFFFFFCu) = 1; for (;;) {} }")


def test_time_follows_the_instruction_count(tmp_path: Path) -> None:
    """A loop of two instructions: at 3/2 cycles each and 16 MHz, 5333 rounds a millisecond."""
    soc = Soc(
        build(
            tmp_path,
            '__attribute__((naked)) void reset(void) { __asm volatile("movs r0, #0\\n 1: adds r0, #1\\n b 1b"); }',
        )
    )
    soc.run_for(1e-3)
    assert soc.cpu.register("r0") == pytest.approx(16000 / 3, abs=1)
    assert soc.clock.instructions == pytest.approx(2 * 16000 / 3, abs=3)
