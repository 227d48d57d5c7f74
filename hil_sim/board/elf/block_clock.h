/* Counts what the emulated processor executes, and stops it in time.
 *
 * What it is for: the emulator calls block_clock_hook() before each block of instructions. A call into
 * Python per block would cost more than the block; this one costs some ten nanoseconds.
 *
 * Time: an instruction takes cpi_num / cpi_den cycles of the processor's clock. Python owns every field and
 * reads or writes them while the emulator stands still or calls back.
 */
#ifndef BLOCK_CLOCK_H
#define BLOCK_CLOCK_H

#include <stdint.h>

typedef struct {
    uint64_t cycles;       /* since power-on */
    uint64_t deadline;     /* the block that would begin at or after it is not run */
    uint64_t instructions; /* executed since power-on */
    uint64_t blocks;       /* begun since power-on */
    uint32_t cpi_num, cpi_den;
    uint32_t remainder;      /* of the last division by cpi_den */
    uint32_t block_pc;       /* address of the block that runs */
    uint32_t stopped;        /* 1: this clock stopped the emulator */
    uint32_t watch_priority; /* priority of an interrupt that waits for a mask to open; 256: none waits */
    uint32_t code_base, code_size;
    uintptr_t code;     /* the host's copy of the code memory */
    uintptr_t stop;     /* int uc_emu_stop(uc_engine *) */
    uintptr_t reg_read; /* int uc_reg_read(uc_engine *, int, void *) */
    int32_t reg_primask, reg_basepri;
} block_clock;

void block_clock_hook(void *engine, uint64_t address, uint32_t size, void *user);
uint32_t block_clock_count(const block_clock *clock, uint32_t address, uint32_t size);

#endif
