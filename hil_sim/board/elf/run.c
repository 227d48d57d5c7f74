/* Running the chip: events, exceptions in and out (PM0214 2.3.7), the processor until the next event, sleep.
 */
#include "chip.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { EXCEPTION_EXIT = 8 }; /* Unicorn's number for a branch to EXC_RETURN */
enum { NO_FP_FRAME = 1 << 4, FPCA = 1 << 2, SPSEL = 1 << 1 };
enum { FRAME_BYTES = 0x20, EXTENDED_BYTES = 0x68, FP_WORDS = 17 };
static const uint32_t RETURN_HANDLER = 0xFFFFFFF1u;
static const uint32_t RETURN_THREAD = 0xFFFFFFF9u;
static const uint32_t XPSR_ALIGNED = 1u << 9;
static const uint32_t XPSR_THUMB = 1u << 24;
static const uint32_t XPSR_FLAGS = 0xF80F0000u; /* the handler starts outside any IT block */
static const uint16_t WFI = 0xBF30u;

void chip_violate(chip *c, const char *bank_name, const char *section, const char *rule) {
    if (!c->failed) {
        c->failed = c->violated = 1;
        c->violation_bank = bank_name;
        c->violation_section = section;
        (void)snprintf(c->violation_rule, sizeof c->violation_rule, "%s", rule);
        ((int (*)(void *))c->clock.stop)(c->engine);
    }
}

static void fault(chip *c, const char *text) {
    chip_violate(c, "CPU", "PM0214 2.3.7", text);
}

/* --- registers of the processor ------------------------------------------------------------------ */

static uint32_t get(chip *c, int32_t id) {
    uint32_t value = 0;
    (void)c->reg_read(c->engine, id, &value);
    return value;
}

static void set(chip *c, int32_t id, uint32_t value) {
    (void)c->reg_write(c->engine, id, &value);
}

static uint8_t *memory(chip *c, uint32_t address, uint32_t size) {
    if (address >= c->ram_base && address - c->ram_base <= c->ram_size - size) {
        return c->ram + (address - c->ram_base);
    }
    if (address >= c->flash_base && address - c->flash_base <= c->flash_size - size) {
        return c->flash + (address - c->flash_base);
    }
    return NULL;
}

/* A priority that the masks hold back; those below 0 know no mask. */
static int masked(chip *c, int32_t priority) {
    if (priority < 0) {
        return 0;
    }
    const uint32_t basepri = get(c, c->id_basepri);
    if ((get(c, c->id_faultmask) & 1u) != 0) {
        fault(c, "FAULTMASK is set; the emulator does not model it");
    }
    return (get(c, c->id_primask) & 1u) != 0 || (basepri != 0 && priority >= (int32_t)basepri);
}

/* --- exceptions ---------------------------------------------------------------------------------- */

static void go(chip *c, uint32_t exception, uint32_t sp, uint32_t lr) {
    const uint8_t *vector = memory(c, c->vectors + 4 * exception, 4);
    uint32_t handler = 0;
    if (vector == NULL) {
        fault(c, "the vector table is in no memory");
        return;
    }
    memcpy(&handler, vector, 4);
    uint32_t xpsr = (get(c, c->id_xpsr) & XPSR_FLAGS) | XPSR_THUMB | exception;
    uint32_t pc = handler & ~1u;
    int ids[4] = {c->id_xpsr, c->id_sp, c->id_lr, c->id_pc};
    void *const values[4] = {&xpsr, &sp, &lr, &pc};
    (void)c->reg_write_batch(c->engine, ids, values, 4);
}

static void enter(chip *c, uint32_t exception, int nested) {
    uint32_t frame[8];
    uint32_t sp = 0;
    uint32_t control = 0;
    int ids[10] = {c->id_r[0], c->id_r[1], c->id_r[2], c->id_r[3], c->id_r12,
                   c->id_lr,   c->id_pc,   c->id_xpsr, c->id_sp,   c->id_control};
    void *values[10] = {&frame[0], &frame[1], &frame[2], &frame[3], &frame[4],
                        &frame[5], &frame[6], &frame[7], &sp,       &control};
    (void)c->reg_read_batch(c->engine, ids, values, 10);
    if ((control & SPSEL) != 0) {
        fault(c, "the thread uses the process stack; the emulator does not model it");
        return;
    }
    const int extended = (control & FPCA) != 0;
    const uint32_t size = extended ? EXTENDED_BYTES : FRAME_BYTES;
    const uint32_t aligned = (sp - size) & ~4u; /* CCR.STKALIGN: remembered in xPSR bit 9 */
    frame[7] = (frame[7] & ~XPSR_ALIGNED) | ((sp & 4u) != 0 ? XPSR_ALIGNED : 0);
    uint8_t *stack = aligned < c->ram_base ? NULL : memory(c, aligned, size);
    if (stack == NULL) {
        fault(c, "stacking failed: there is no RAM");
        return;
    }
    memcpy(stack, frame, sizeof frame);
    if (extended) {
        uint32_t singles[FP_WORDS + 1];
        for (int n = 0; n < 16; ++n) {
            singles[n] = get(c, c->id_s0 + n);
        }
        singles[16] = get(c, c->id_fpscr);
        singles[17] = 0;
        memcpy(stack + FRAME_BYTES, singles, sizeof singles);
        set(c, c->id_control, control & ~(uint32_t)FPCA);
    }
    go(c, exception, aligned,
       (nested ? RETURN_HANDLER : RETURN_THREAD) & ~(extended ? (uint32_t)NO_FP_FRAME : 0u));
    c->clock.cycles += ENTRY_CYCLES;
}

static void leave(chip *c) {
    const uint32_t exc_return = c->exit_return;
    const uint32_t sp = get(c, c->id_sp);
    const int extended = (exc_return & NO_FP_FRAME) == 0;
    const uint32_t size = extended ? EXTENDED_BYTES : FRAME_BYTES;
    const uint32_t kind = exc_return | NO_FP_FRAME;
    const uint8_t *stack = memory(c, sp, size);
    if ((kind != RETURN_HANDLER && kind != RETURN_THREAD) || stack == NULL) {
        fault(c, "EXC_RETURN names a stack that the emulator does not model");
        return;
    }
    uint32_t frame[8];
    memcpy(frame, stack, sizeof frame);
    if (extended) {
        uint32_t singles[FP_WORDS];
        memcpy(singles, stack + FRAME_BYTES, sizeof singles);
        for (int n = 0; n < 16; ++n) {
            set(c, c->id_s0 + n, singles[n]);
        }
        set(c, c->id_fpscr, singles[16]);
    }
    if (((frame[7] & 0x1FFu) == 0) != (kind == RETURN_THREAD)) {
        fault(c, "EXC_RETURN does not fit the stacked xPSR");
        return;
    }
    uint32_t back = (sp + size) | ((frame[7] & XPSR_ALIGNED) != 0 ? 4u : 0u);
    uint32_t xpsr = frame[7] & ~XPSR_ALIGNED;
    uint32_t pc = frame[6] & ~1u;
    int ids[9] = {c->id_r[0], c->id_r[1], c->id_r[2], c->id_r[3], c->id_r12,
                  c->id_lr,   c->id_sp,   c->id_xpsr, c->id_pc};
    void *const values[9] = {&frame[0], &frame[1], &frame[2], &frame[3], &frame[4],
                             &frame[5], &back,     &xpsr,     &pc};
    (void)c->reg_write_batch(c->engine, ids, values, 9);
    set(c, c->id_control, (get(c, c->id_control) & ~(uint32_t)FPCA) | (extended ? (uint32_t)FPCA : 0u));
    c->clock.cycles += EXIT_CYCLES;
}

static void begin(chip *c, uint32_t exception) {
    c->pending[exception / 32] &= ~(1u << exception % 32);
    if (c->nested == MAX_NESTED) {
        fault(c, "exceptions are nested too deeply");
        return;
    }
    c->active[c->nested++] = exception;
    if (c->watched) {
        chip_exception(c, exception, 1);
    }
}

/* Enters the most urgent pending exception, or leaves word to watch the mask that holds it back. */
static void take_interrupt(chip *c) {
    c->clock.watch_priority = THREAD;
    const int32_t candidate = c->interrupts_held ? -1 : nvic_candidate(c);
    if (candidate < 0) {
        return;
    }
    const int32_t priority = nvic_priority(c, (uint32_t)candidate);
    if (c->sleeping) {
        const uint32_t basepri = get(c, c->id_basepri);
        c->sleeping = !(basepri == 0 || priority < (int32_t)basepri);
    }
    if (masked(c, priority)) {
        c->clock.watch_priority = (uint32_t)priority;
        return;
    }
    const int nested = nvic_execution_priority(c) != THREAD;
    begin(c, (uint32_t)candidate);
    enter(c, (uint32_t)candidate, nested);
}

/* A handler has ended: the next pending one is chained, or the frame is popped. */
static void return_from_handler(chip *c) {
    const uint32_t finished = c->nested > 0 ? c->active[--c->nested] : 0;
    if ((c->lines[finished / 32] >> finished % 32 & 1u) != 0) {
        c->pending[finished / 32] |= 1u << finished % 32;
    }
    if (c->watched) {
        chip_exception(c, finished, 0);
    }
    const int32_t following = c->interrupts_held ? -1 : nvic_candidate(c);
    if (following >= 0 && !masked(c, nvic_priority(c, (uint32_t)following))) {
        begin(c, (uint32_t)following);
        go(c, (uint32_t)following, get(c, c->id_sp), c->exit_return);
        c->clock.cycles += TAIL_CYCLES;
    } else {
        leave(c);
    }
}

void chip_interrupt_hook(void *engine, uint32_t number, void *user) {
    chip *c = user;
    if (number == EXCEPTION_EXIT) {
        c->exit_return = get(c, c->id_pc) | 1u;
        ((int (*)(void *))c->clock.stop)(engine);
    } else {
        char text[64];
        (void)snprintf(text, sizeof text, "processor exception %u", number);
        fault(c, text);
    }
}

/* --- running ------------------------------------------------------------------------------------- */

/* WFI ends for an interrupt that would preempt if PRIMASK were clear (PM0214 2.5.3). */
static int wakes(chip *c) {
    const int32_t candidate = nvic_candidate(c);
    const uint32_t basepri = get(c, c->id_basepri);
    return candidate >= 0 && (basepri == 0 || nvic_priority(c, (uint32_t)candidate) < (int32_t)basepri);
}

/* Executes until a cycle, a WFI, or the end of a handler. */
static int execute(chip *c, uint64_t deadline) {
    c->clock.deadline = deadline;
    c->clock.stopped = 0;
    c->exit_return = 0;
    c->unicorn_error = c->emu_start(c->engine, get(c, c->id_pc) | 1u, 0, 0, 0);
    if (c->flash_touched) {
        c->flash_touched = 0;
        chip_settle(c);
    }
    if (c->failed) {
        return CHIP_FAILED;
    }
    if (c->unicorn_error != 0) {
        return CHIP_UNICORN_ERROR;
    }
    schedule_fire(c, c->clock.cycles);
    if (c->exit_return != 0) {
        return_from_handler(c);
    } else if (!c->clock.stopped) {
        const uint8_t *code = memory(c, get(c, c->id_pc) - 2u, 2);
        uint16_t last = 0;
        if (code != NULL) {
            memcpy(&last, code, 2);
        }
        if (last != WFI) {
            return CHIP_STOPPED;
        }
        c->sleeping = !wakes(c);
    }
    return c->failed ? CHIP_FAILED : CHIP_DONE;
}

/* How far a sleeping chip may be taken in one go: the watchdog's reset ends it. */
static uint64_t quiet_until(const chip *c, uint64_t cycle) {
    const event *bite = c->iwdg->bite;
    if (bite == NULL || bite->cycle >= cycle) {
        return cycle;
    }
    return bite->cycle > c->clock.cycles ? bite->cycle : c->clock.cycles;
}

/* Until (just past) a cycle; CHIP_RESET: a reset is due first. */
int chip_run_until(chip *c, uint64_t cycle) {
    for (;;) {
        schedule_fire(c, c->clock.cycles);
        if (c->failed) {
            return CHIP_FAILED;
        }
        if (c->reset_requested) {
            return CHIP_RESET;
        }
        if (c->clock.cycles >= cycle) {
            return CHIP_DONE;
        }
        take_interrupt(c);
        if (c->failed) {
            return CHIP_FAILED;
        }
        const uint64_t next = schedule_next(c);
        const uint64_t deadline = next < cycle ? next : cycle;
        if (deadline <= c->clock.cycles) {
            continue;
        }
        if (c->sleeping || (c->thread_held && c->nested == 0)) {
            c->clock.cycles = nvic_any_pending(c) || c->reset_requested
                                  ? deadline
                                  : schedule_fire_while_quiet(c, quiet_until(c, cycle));
            continue;
        }
        const int status = execute(c, deadline);
        if (status != CHIP_DONE) {
            return status;
        }
    }
}

/* --- buses --------------------------------------------------------------------------------------- */

static bank *find(chip *c, uint32_t offset) {
    bank *b = offset >> PAGE_SHIFT < PAGES ? c->pages[offset >> PAGE_SHIFT] : NULL;
    return b != NULL && b->clocked ? b : NULL;
}

static const uint32_t BUS_BASE = 0x40000000u;

/* What is due before an access has happened before it. */
uint64_t chip_bus_read(void *engine, uint64_t offset, unsigned size, void *user) {
    chip *c = user;
    (void)engine;
    schedule_fire(c, c->clock.cycles);
    bank *b = find(c, (uint32_t)offset);
    uint32_t value = 0;
    if (b == NULL || !b->read(b, BUS_BASE + (uint32_t)offset - b->base, size, &value)) {
        value = chip_read(c, BUS_BASE + (uint32_t)offset, size);
    }
    return value;
}

void chip_bus_write(void *engine, uint64_t offset, unsigned size, uint64_t value, void *user) {
    chip *c = user;
    (void)engine;
    schedule_fire(c, c->clock.cycles);
    bank *b = find(c, (uint32_t)offset);
    if (b == NULL || !b->write(b, BUS_BASE + (uint32_t)offset - b->base, size, (uint32_t)value)) {
        chip_write(c, BUS_BASE + (uint32_t)offset, size, (uint32_t)value);
    }
    const uint64_t next = schedule_next(c);
    if (next < c->clock.deadline) {
        c->clock.deadline = next;
    }
}

/* A pin is switched to the signal. */
int chip_route(chip *c, int32_t signal) {
    if (c->routes[signal] < 0) {
        c->routes[signal] = (int8_t)(chip_routed(c, signal) != 0);
    }
    return c->routes[signal];
}

/* Until a time since power-on; the processor's clock may change meanwhile, so a millisecond at most in one
 * go. */
int chip_run_for(chip *c, double end) {
    while (schedule_seconds(c) < end - 0.5 / c->frequency) {
        const uint64_t last = c->base_cycle + (uint64_t)llrint((end - c->base_seconds) * c->frequency);
        const uint64_t next = c->clock.cycles + (uint64_t)(1e-3 * c->frequency);
        const int status = chip_run_until(c, last < next ? last : next);
        if (status != CHIP_DONE) {
            return status;
        }
    }
    return CHIP_DONE;
}

void chip_free(chip *c) {
    schedule_start(c, 0, 0.0, 1.0);
    free(c->heap);
}
