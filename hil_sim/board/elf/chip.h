/* The chip's inner loop: time, interrupts, buses, and the models that are busy while the firmware samples.
 *
 * What it is for: at a thousand ticks, eight thousand conversions and some ten thousand bytes a second a call
 * into Python per event would cost more than everything the emulated processor executes. Here is what happens
 * often; what happens once (clocks, configuration, errors) is Python's, on the same state.
 *
 * Data flow: chip_run_until() lets events happen and the processor execute until a cycle. The processor's
 * accesses to a register bank come to its read() or write(); what these do not know goes to chip_read() and
 * chip_write(), which Python provides. Whatever is not modelled sets `failed` and stops the loop; Python
 * raises it. Ownership: Python allocates and keeps every struct; events belong to the schedule. Registers
 * stand at offset / 4 in `reg`. Numbers of sections are of RM0390 unless PM0214 is named.
 */
#ifndef CHIP_H
#define CHIP_H

#include "block_clock.h"

#include <stddef.h>
#include <stdint.h>

enum { CHIP_DONE, CHIP_RESET, CHIP_FAILED, CHIP_UNICORN_ERROR, CHIP_STOPPED };
enum { TIM2, TIM3, TIM4, TIM5, TIM12, TIMERS };
enum { GPIO_A, GPIO_B, GPIO_C, GPIO_H, GPIOS };
enum { DMA_1, DMA_2, DMAS };
enum { REQUEST_TIM2_CH3, REQUEST_TIM5_CH3, REQUEST_USART2_RX, REQUEST_USART2_TX, REQUEST_ADC1, REQUESTS };
enum { EXCEPTIONS = 113, FIRST_IRQ = 16, NMI = 2, THREAD = 256, MAX_NESTED = 16 };
enum { PAGES = 512, PAGE_SHIFT = 10 };
enum { ENTRY_CYCLES = 12, EXIT_CYCLES = 10, TAIL_CYCLES = 6 }; /* Cortex-M4 TRM 3.9.1, without wait states */
enum { CAN_RECOVERY_BITS = 1408 };                             /* 128 times 11 (30.7.6) */

typedef struct chip chip;
typedef void (*event_act)(chip *c, void *owner, uint64_t detail);

typedef struct event {
    uint64_t cycle, order;
    double seconds; /* when it is to happen, if it follows time rather than the processor's clock; else below
                       0 */
    event_act act;  /* 0: cancelled */
    void *owner;
    uint64_t detail;
} event;

typedef struct bank bank;
struct bank {
    chip *chip;
    const char *name;
    uint32_t base;
    uint32_t clocked;
    /* 1: done; 0: Python's business. */
    int (*read)(bank *b, uint32_t offset, uint32_t size, uint32_t *value);
    int (*write)(bank *b, uint32_t offset, uint32_t size, uint32_t value);
};

/* What the world puts on the analogue inputs and the encoders; see board.py. */
typedef struct {
    double first_trigger_s; /* of row 0 */
    int64_t first_row;      /* of those that run */
    int64_t rows;
    int32_t channels[2];   /* of x and y */
    const uint16_t *codes; /* (rows, 8, 2) */
    const int64_t *counts; /* (rows + 1, 2): the row before, then those that run */
    uint32_t converting;
} world;

typedef struct {
    bank bank;
    uint32_t reg[16];
    uint32_t driven, levels; /* pins that the world drives, and how */
} gpio;

typedef struct {
    uint32_t reg[6]; /* CR, NDTR, PAR, M0AR, M1AR, FCR */
    uint32_t flags;
    uint32_t total, size, offset;
    bank *peripheral; /* 0: one that Python has */
    uint32_t failing, block_ended;
    uint32_t irq;
} dma_stream;

typedef struct {
    bank bank;
    dma_stream streams[8];
} dma;

typedef struct {
    bank bank;
    uint32_t reg[20];
    uint32_t number, irq, top;
    uint32_t arr, psc; /* behind the preload */
    uint64_t count, since;
    event *overflow;
    int32_t source;        /* the timer whose TRGO is TRGI; -1: none */
    uint32_t trc_channels; /* bit n: channel n captures at the trigger */
    int32_t signals[2];    /* routing of TI1 and TI2, see chip_routed */
    uint32_t follows;      /* 0: no encoder; 1: the world's; 2: Python's */
    uint32_t axis;         /* of the world's encoders */
    uint32_t placed;       /* last_position is known */
    int64_t last_position;
} timer;

typedef struct {
    bank bank;
    uint32_t reg[2][20]; /* ADC1, ADC2 */
    uint32_t common[3];  /* CSR, CCR, CDR */
    uint64_t busy_until, injected_until;
    uint32_t overrun, requests_over;
    uint32_t first, second, both, master; /* of the conversion under way */
    int32_t trigger;                      /* the timer; -1: none */
} adc;

typedef struct {
    bank bank;
    uint32_t reg[6];
    uint32_t irq;
    int32_t tx_signal, rx_signal;
    int32_t holding; /* DR, waiting for the shift register; -1: empty */
    uint32_t shifting, received, status_read;
    uint32_t damaged; /* so many of the next bytes arrive with noise and a bad stop bit */
    event *idle, *arrival;
    double line_rate;
    uint8_t *incoming;
    size_t incoming_first, incoming_count, incoming_room;
    uint8_t *sent;
    size_t sent_count, sent_room;
} usart;

typedef struct {
    uint32_t identifier, length;
    uint8_t data[8];
} can_frame;

typedef struct {
    can_frame *frames;
    size_t first, count, room;
} can_queue;

typedef struct {
    bank bank;
    uint32_t reg[144];
    uint32_t words[3][4];
    uint64_t order[3];
    uint64_t requests;
    can_frame fifos[2][3];
    uint32_t filters[28][2];
    uint32_t fifo_count[2];
    int32_t tx_signal, rx_signal;
    int32_t sending; /* mailbox; -1: none */
    event *bus_event, *recovering;
    uint32_t bus_off, acknowledged;
    int32_t damaged_transmissions, tec, rec;
    can_queue waiting; /* frames of other nodes */
    can_queue sent;
} can;

typedef struct {
    bank bank;
    uint32_t reg[4];
    double timeout_s;
    uint32_t running, unlocked;
    event *bite;
} iwdg;

struct chip {
    block_clock clock; /* first: the hook before each block gets the same address */
    void *handle;      /* Python's chip */
    uint32_t failed;
    uint32_t violated; /* `failed` because of a rule of the manual: the next three say which */
    const char *violation_bank, *violation_section;
    char violation_rule[128];

    /* schedule.c */
    uint64_t now;
    double frequency;
    uint64_t base_cycle;
    double base_seconds;
    event **heap;
    size_t events, room;
    uint64_t ordered;

    /* nvic.c */
    uint32_t enabled[4], pending[4], lines[4];
    uint16_t priority[EXCEPTIONS];
    uint32_t active[MAX_NESTED], nested;

    /* exception.c */
    void *engine;
    int (*emu_start)(void *, uint64_t, uint64_t, uint64_t, size_t);
    int (*reg_read)(void *, int, void *);
    int (*reg_write)(void *, int, const void *);
    int (*reg_read_batch)(void *, int *, void **, int);
    int (*reg_write_batch)(void *, int *, void *const *, int);
    int32_t id_r[4], id_r12, id_lr, id_pc, id_xpsr, id_sp, id_control, id_primask, id_basepri, id_faultmask;
    int32_t id_s0, id_fpscr;
    uint8_t *flash, *ram;
    uint32_t flash_base, flash_size, ram_base, ram_size;
    uint32_t vectors;
    uint32_t exit_return; /* EXC_RETURN that ended the last run; 0: none */
    int32_t unicorn_error;

    /* run.c */
    uint32_t sleeping, thread_held, interrupts_held, reset_requested, watched, flash_touched;
    uint32_t apb1, apb2; /* HCLK over PCLK1 and PCLK2 */
    uint32_t timer_divider;
    bank *pages[PAGES];
    int8_t routes[16]; /* -1: ask */

    gpio *gpios[GPIOS];
    dma *dmas[DMAS];
    timer *timers[TIMERS];
    adc *adc;
    usart *usart;
    can *can;
    iwdg *iwdg;
    world *world;
};

/* schedule.c */
event *schedule_at(chip *c, uint64_t cycle, event_act act, void *owner, uint64_t detail);
event *schedule_after_seconds(chip *c, double delay, event_act act, void *owner, uint64_t detail);
void schedule_cancel(event *e);
void schedule_fire(chip *c, uint64_t until);
uint64_t schedule_fire_while_quiet(chip *c, uint64_t until);
uint64_t schedule_next(chip *c); /* UINT64_MAX: nothing is to happen */
double schedule_seconds(const chip *c);
void schedule_set_frequency(chip *c, double frequency);
void schedule_start(chip *c, uint64_t cycle, double seconds, double frequency);
event *schedule_python(chip *c, uint64_t cycle, uint64_t number);
event *schedule_python_after_seconds(chip *c, double delay, uint64_t number);

/* nvic.c */
void nvic_pend(chip *c, uint32_t exception);
void nvic_set_line(chip *c, uint32_t irq, int high);
int32_t nvic_priority(const chip *c, uint32_t exception);
int32_t nvic_execution_priority(const chip *c);
int32_t nvic_candidate(const chip *c); /* -1: none */
int nvic_any_pending(const chip *c);

/* run.c */
int chip_run_until(chip *c, uint64_t cycle);
int chip_run_for(chip *c, double end);
void chip_free(chip *c);
void chip_violate(chip *c, const char *bank_name, const char *section, const char *rule);
int chip_route(chip *c, int32_t signal);
uint64_t chip_bus_read(void *engine, uint64_t offset, unsigned size, void *user);
void chip_bus_write(void *engine, uint64_t offset, unsigned size, uint64_t value, void *user);
void chip_interrupt_hook(void *engine, uint32_t number, void *user);

/* the models */
void gpio_bind(gpio *g);
uint32_t gpio_inputs(const gpio *g);
void dma_bind(dma *d);
int dma_request(chip *c, int source);
void dma_update_line(dma *d, uint32_t stream);
void dma_set_flags(dma *d, uint32_t stream, uint32_t flags);
void timer_bind(timer *t);
uint64_t timer_count(timer *t);
void timer_restart(timer *t, uint64_t count);
void timer_update(timer *t, int flag);
void timer_capture(timer *t, uint32_t channel);
void timer_turn(timer *t, int64_t counts);
void timer_place(timer *t);
void timer_update_line(timer *t);
uint32_t timer_read_capture(timer *t, uint32_t channel);
void adc_bind(adc *a);
void adc_trigger(adc *a, int32_t number);
void adc_start(adc *a, uint32_t master);
void adc_start_injected(adc *a, uint32_t master);
void adc_update_line(adc *a);
uint32_t adc_read_cdr(adc *a);
uint32_t adc_read_dr(adc *a, uint32_t unit);
uint32_t adc_clock_divider(adc *a);
double adc_held_after_s(adc *a, uint32_t channel);
void usart_bind(usart *u);
void usart_feed(usart *u);
void usart_offer(usart *u);
void usart_receive(usart *u, const uint8_t *data, size_t count, double baud);
void usart_update_line(usart *u);
uint32_t usart_read_sr(usart *u);
uint32_t usart_read_dr(usart *u);
void usart_write_dr(usart *u, uint32_t value);
void usart_free(usart *u);
void can_bind(can *n);
uint32_t can_read_tsr(const can *n);
uint32_t can_read_fifo(const can *n, uint32_t fifo);
uint32_t can_read_esr(const can *n);
void can_write_tsr(can *n, uint32_t value);
void can_write_fifo(can *n, uint32_t fifo, uint32_t value);
void can_receive(can *n, uint32_t identifier, const uint8_t *data, uint32_t length);
void can_arbitrate(can *n);
void can_recovered(can *n);
void can_update_lines(can *n);
void can_counters_changed(can *n, uint32_t lec);
uint64_t can_bit_cycles(const can *n);
uint64_t can_frame_bits(uint32_t length);
void can_free(can *n);
void iwdg_bind(iwdg *w);
void iwdg_reload(iwdg *w);
uint32_t world_code(const world *w, double seconds, uint32_t axis);
int64_t world_position(const world *w, double seconds, uint32_t axis);

/* What Python provides; nothing here raises. */
extern uint32_t chip_read(chip *c, uint32_t address, uint32_t size);
extern void chip_write(chip *c, uint32_t address, uint32_t size, uint32_t value);
extern int chip_routed(chip *c, int32_t signal);
extern uint32_t chip_source(chip *c, uint32_t channel);
extern int64_t chip_position(chip *c, uint32_t number);
extern void chip_event(chip *c, uint64_t number);
extern void chip_exception(chip *c, uint32_t exception, int entering);
extern void chip_settle(chip *c);
extern void chip_bite(chip *c);

#endif
