#include "bench.h"

#include "can.h"
#include "flash.h"
#include "impid_messages.h"
#include "inputs.h"
#include "sampling.h"
#include "serial.h"

#define RELEASED 16u /* as the settings say */

static const impid_settings_t *settings;
static bool hang_requested;

void bench_start(const impid_settings_t *the_settings) {
    settings = the_settings;
}

static bool hold_levels(uint32_t levels) {
    if (levels == RELEASED) {
        inputs_start(settings);
    } else if (levels < RELEASED) {
        inputs_hold(levels);
    } else {
        return false;
    }
    return true;
}

static bool act(void *context, uint8_t item, uint32_t value, uint32_t *answer) {
    (void)context;
    switch (item) {
    case IMPID_MESSAGES_COMMAND_ITEM_BENCH_EDGE_CHOICE:
        *answer = SAMPLING_TRIGGER_CLOCKS;
        return sampling_edge(value);
    case IMPID_MESSAGES_COMMAND_ITEM_BENCH_LEVELS_CHOICE:
        return hold_levels(value);
    case IMPID_MESSAGES_COMMAND_ITEM_BENCH_COUNT_1_CHOICE:
        *answer = sampling_latest()->encoder[0];
        return true;
    case IMPID_MESSAGES_COMMAND_ITEM_BENCH_COUNT_2_CHOICE:
        *answer = sampling_latest()->encoder[1];
        return true;
    case IMPID_MESSAGES_COMMAND_ITEM_BENCH_CODES_CHOICE:
        *answer = sampling_latest()->codes;
        return true;
    case IMPID_MESSAGES_COMMAND_ITEM_BENCH_CAN_LOOPBACK_CHOICE:
        return can_loop_start(value);
    case IMPID_MESSAGES_COMMAND_ITEM_BENCH_CAN_LOOPED_CHOICE:
        *answer = can_looped();
        return true;
    case IMPID_MESSAGES_COMMAND_ITEM_BENCH_CUT_CHOICE:
        flash_cut_after(value);
        return true;
    case IMPID_MESSAGES_COMMAND_ITEM_BENCH_HANG_CHOICE:
        hang_requested = true;
        return true;
    default:
        return false;
    }
}

const impid_bench_port_t bench_port = {.context = NULL, .act = act};

void bench_poll(void) {
    /* Endless on purpose: the watchdog is what is being tested. */
    while (hang_requested && serial_done()) {
    }
}
