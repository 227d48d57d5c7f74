/* What the converters and the encoders see; the picture is drawn in board.py. */
#include "chip.h"

#include <math.h>
#include <stdlib.h>

static const double TRIGGER_S = 125e-6;
static const double TICK_S = 1e-3;
static const double REST_TRIGGERS = 1e-6 / 125e-6; /* 1 us */
static const double REST_TICKS = 1e-3;             /* 1 us */

/* 0 while the chip boots. */
static int64_t code(const world *w, int64_t conversion, uint32_t axis) {
    const int64_t place = conversion - 8 * w->first_row;
    return place >= 0 && place < 8 * w->rows ? w->codes[2 * place + axis] : 0;
}

uint32_t world_code(const world *w, double seconds, uint32_t axis) {
    const double place = (seconds - w->first_trigger_s) / TRIGGER_S;
    const int64_t nearest = llrint(place);
    if (fabs(place - (double)nearest) <= REST_TRIGGERS) {
        return (uint32_t)code(w, nearest, axis);
    }
    const int64_t low = (int64_t)place;
    const int64_t before = code(w, low, axis);
    const int64_t after = code(w, low + 1, axis);
    return (uint32_t)(before + llrint((place - (double)low) * (double)(after - before)));
}

static int64_t clamp(int64_t value, int64_t low, int64_t high) {
    return value < low ? low : value > high ? high : value;
}

int64_t world_position(const world *w, double seconds, uint32_t axis) {
    const double since = seconds - w->first_trigger_s - 7.0 * TRIGGER_S;
    const double place = since / TICK_S - (double)w->first_row + 1.0;
    const int64_t nearest = llrint(place);
    if (fabs(place - (double)nearest) <= REST_TICKS) {
        return w->counts[2 * clamp(nearest, 0, w->rows) + axis];
    }
    const int64_t low = clamp((int64_t)place, 0, w->rows > 0 ? w->rows - 1 : 0);
    const int64_t high = low + 1 <= w->rows ? low + 1 : w->rows;
    const double share = fmin(fmax(place - (double)low, 0.0), 1.0);
    const int64_t begin = w->counts[2 * low + axis];
    return begin + llrint(share * (double)(w->counts[2 * high + axis] - begin));
}
