/* A sensor board in a process: the firmware core with a port that a caller drives.
 *
 * What it is for: tests and the simulator run exactly the core that ships, fed with the readings that
 * the converters and counters of a real board would have given.
 *
 * Data flow: impid_board_run() stands for the timer interrupt and the main loop of the board. For each
 * tick (1 ms) it takes IMPID_ADC_PER_TICK conversions of both axes and the two encoder counters, then
 * lets the main loop run once. What the board sends waits in the board until *_take() fetches it; what
 * it receives is given to *_receive().
 *
 * Time: the board's own clock in microseconds since its boot. Tick k happens at start_us + k * 1000.
 * Conversion j of that tick (j = 0..7) happened at the tick's time + (j - 7) * 125 us: the last one and
 * the encoder latch share the instant of the tick. Between ticks the clock follows the t_us that the
 * caller passes to *_receive() and _advance(). A line of finite speed empties itself as that clock goes on:
 * what has not left by then is not there to be taken.
 *
 * The sample that leaves at tick k belongs to the instant of tick k - 2: the decimation filter (28 taps,
 * linear phase, 1687.5 us) and the accelerometer's output filter (500 Hz, 318.3 us) together delay the
 * acceleration by 2.006 ms, and the core pairs it with the encoder counts of two ticks earlier.
 *
 * Ownership: the caller owns the board between _new and _free, and every buffer it passes in. Not
 * thread-safe: one board, one thread. The heap is used by _new alone.
 */
#ifndef IMPID_BOARD_H
#define IMPID_BOARD_H

#include <stddef.h>
#include <stdint.h>

#define IMPID_ADC_PER_TICK 8u

/* Two sectors of 16 KiB, as on the chip. */
#define IMPID_BOARD_FLASH_WORDS 8192u

/* Memory that a reset leaves as it is, and a loss of power does not. */
#define IMPID_BOARD_RETAINED_WORDS 3u

/* What may wait for *_take(): over three minutes of streaming. When full, the line takes no more and the
 * board counts what it drops, as with a cable that nobody reads. */
#ifndef IMPID_BOARD_SERIAL_CAPACITY /* a machine with less memory may set both lower */
#define IMPID_BOARD_SERIAL_CAPACITY (4u * 1024u * 1024u)
#define IMPID_BOARD_CAN_CAPACITY    (384u * 1024u)
#endif

typedef struct impid_board impid_board;

typedef struct {
    uint32_t uid[3];
    uint16_t boot_id;
    uint8_t reset_cause;  /* as in the message set: STATUS_HEALTH.reset_cause */
    uint32_t first_index; /* index of the first sample after START: tests of the wrap set it near 2^32 */
    uint64_t start_us;    /* board time of tick 0: tests of the wrap set it near 2^32 */
    uint32_t serial_bytes_per_ms; /* what the serial line carries (92 at 921600 baud); 0: no limit */
    uint32_t can_frames_per_ms;   /* what the bus carries; 0: no limit */
    uint8_t digital; /* 1: its accelerometer is impid_adxl355, to be run by _run_wide; 0: impid_adxl203 */
    /* IMPID_BOARD_FLASH_WORDS words in which the board keeps its settings, all bits 1 when new: the caller's,
     * so that they outlive the board, in a mapped file if need be. NULL: a new flash, gone with the board. */
    uint32_t *flash;
    /* IMPID_BOARD_RETAINED_WORDS words: the caller's, which the next board after a reset gets again. NULL:
     * its own. */
    uint32_t *retained;
} impid_board_config;

typedef struct {
    uint16_t id;
    uint8_t dlc;
    uint8_t data[8];
} impid_board_can_frame;

impid_board *impid_board_new(const impid_board_config *config); /* NULL: no memory */
void impid_board_free(impid_board *board);

/* adc: ticks * 8 * 2 codes of 12 bits, x then y; encoder: ticks * 2 counts; faults: ticks bytes of
 * IMPID_BOARD_* bits, or NULL. */
#define IMPID_BOARD_ENCODER_FAULT 0x01u /* the counter reports a lost line in this tick */
#define IMPID_BOARD_SYNC_EDGE     0x02u /* an edge on the sync input within this tick */
#define IMPID_BOARD_LATE          0x04u /* the tick's interrupt was served more than one period late */
#define IMPID_BOARD_STALLED       0x08u /* the main loop does not run in this tick */
void impid_board_run(impid_board *board, size_t ticks, const uint16_t *adc, const int32_t *encoder,
                     const uint8_t *faults);
/* The same of the digital sensor. readings: ticks * 3 codes of 20 bits, those of x, y and z that lie in the
 * sensor at the tick. */
void impid_board_run_wide(impid_board *board, size_t ticks, const uint32_t *readings, const int32_t *encoder,
                          const uint8_t *faults);

uint64_t impid_board_now_us(const impid_board *board);
/* The clock shows t_us (nothing happens if it is past that) and the lines have carried what they can until
 * then. */
void impid_board_advance(impid_board *board, uint64_t t_us);
/* When all that now waits will have left the board; the clock's own time if nothing waits. */
uint64_t impid_board_lines_idle_us(const impid_board *board);

void impid_board_serial_receive(impid_board *board, const uint8_t *bytes, size_t count, uint64_t t_us);
size_t impid_board_serial_take(impid_board *board, uint8_t *out, size_t capacity);
void impid_board_can_receive(impid_board *board, const impid_board_can_frame *frame, uint64_t t_us);
size_t impid_board_can_take(impid_board *board, impid_board_can_frame *out, size_t capacity);
/* The state of the bus as the controller sees it: a bus-off is counted and recovered from. */
void impid_board_can_bus_off(impid_board *board);

/* 1 while samples leave on some carrier. */
int impid_board_streaming(const impid_board *board);
/* 1 while the self-test pin of the accelerometer is driven: the simulator adds the self-test response. */
int impid_board_self_test_pin(const impid_board *board);
/* 1 once after a RESET command: the caller is to discard this board and make a new one. */
int impid_board_reset_requested(const impid_board *board);

#endif
