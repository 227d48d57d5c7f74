#include "block_clock.h"

#define NO_WATCH 256u

typedef int (*stop_fn)(void *);
typedef int (*reg_read_fn)(void *, int, void *);

/* A Thumb instruction is of two halfwords if the first one's top five bits are 11101, 11110 or 11111
 * (Armv7-M architecture reference manual, A5.1). */
uint32_t block_clock_count(const block_clock *clock, uint32_t address, uint32_t size) {
    const uint8_t *code = (const uint8_t *)clock->code;
    uint32_t count = 0;
    uint32_t offset = address - clock->code_base;
    const uint32_t end = offset + size;
    if (address < clock->code_base || end > clock->code_size) {
        return size / 2u; /* code in RAM: at most this many */
    }
    while (offset < end) {
        offset += (code[offset + 1u] >= 0xE8u) ? 4u : 2u;
        ++count;
    }
    return count;
}

/* An interrupt that a mask holds back enters once PRIMASK is clear and BASEPRI lets its priority pass. */
static int mask_is_open(const block_clock *clock, void *engine) {
    reg_read_fn reg_read = (reg_read_fn)clock->reg_read;
    uint32_t primask = 0;
    uint32_t basepri = 0;
    reg_read(engine, clock->reg_primask, &primask);
    if ((primask & 1u) != 0u) {
        return 0;
    }
    reg_read(engine, clock->reg_basepri, &basepri);
    return basepri == 0u || clock->watch_priority < basepri;
}

void block_clock_hook(void *engine, uint64_t address, uint32_t size, void *user) {
    block_clock *clock = user;
    const int due = clock->cycles >= clock->deadline;
    if (due || (clock->watch_priority != NO_WATCH && mask_is_open(clock, engine))) {
        clock->stopped = 1;
        ((stop_fn)clock->stop)(engine);
        return;
    }
    const uint32_t count = block_clock_count(clock, (uint32_t)address, size);
    const uint32_t scaled = count * clock->cpi_num + clock->remainder;
    clock->block_pc = (uint32_t)address;
    clock->instructions += count;
    clock->blocks += 1u;
    clock->cycles += scaled / clock->cpi_den;
    clock->remainder = scaled % clock->cpi_den;
}
