#include "can.h"

#include "board.h"
#include "clock.h"
#include "interrupts.h"
#include "pin.h"
#include "registers.h"
#include "timebase.h"

#include "impid_messages.h"

#include <string.h>

#define AF_CAN1         9u
#define TRANSMIT_FRAMES 64u /* a power of two */
#define RECEIVE_FRAMES  8u  /* a power of two */
#define MAILBOXES       3u
#define INIT_ATTEMPTS   100000u
#define RELEASE_READS   16u
/* 15 quanta of 45 MHz / 3 / 15 = 1 Mbit/s; sample point (1 + 12) / 15 = 86.7 %. */
#define QUANTA          15u
#define BTR_SEGMENTS    (((12u - 1u) << 16) | ((2u - 1u) << 20))
#define PRESCALER_AT_1M 3u
/* 8 data bytes: 111 bits, and at most 24 stuffed; these payloads average a few. */
#define BITS_PER_FRAME 117u

typedef struct {
    impid_can_frame_t frame;
    uint32_t t_us;
} arrival_t;

static impid_can_frame_t waiting[TRANSMIT_FRAMES];
static volatile uint32_t queued; /* main loop: frames ever queued */
static volatile uint32_t loaded; /* interrupt, or main loop masked: frames ever put into a mailbox */

static arrival_t arrivals[RECEIVE_FRAMES];
static volatile uint32_t arrived;  /* interrupt */
static uint32_t taken;             /* main loop */
static volatile uint32_t refused;  /* interrupt: arrivals that found the queue full */
static volatile uint16_t overruns; /* interrupt: times the controller's own FIFO overflowed */

static uint32_t kilobits;

#define LOOP_FRAMES_MAX 1000u
#define LOOP_LIMIT_US   1000000u
/* Main loop alone. */
static struct {
    uint32_t wanted; /* 0: no loopback */
    uint32_t sent, back, good;
    uint32_t began_us;
} loop;
static volatile uint16_t bus_off;

/* Takes the controller out of its mode, or of sleep, which is the state after reset, and into normal mode
 * with these bits beside the timing. Bounded: without an answer the bus stays silent, and everything else
 * still works. */
static void enter(uint32_t mode) {
    CAN1->MCR = CAN_MCR_INRQ;
    for (uint32_t i = 0; i < INIT_ATTEMPTS && (CAN1->MSR & CAN_MSR_INAK) == 0u; i++) {
    }
    CAN1->BTR = mode | BTR_SEGMENTS | (PRESCALER_AT_1M * 1000u / kilobits - 1u);
    /* Joins the bus once it has seen 11 recessive bits; nobody waits for that, as no bus may be there. */
    CAN1->MCR = CAN_MCR_ABOM | CAN_MCR_TXFP;
}

void can_start(uint32_t kbps) {
    kilobits = kbps;
    clock_enable(&RCC->APB1ENR, RCC_APB1ENR_CAN1);
    pin_alternate(BOARD_CAN_TX, AF_CAN1, PIN_PULL_NONE);
    pin_alternate(BOARD_CAN_RX, AF_CAN1, PIN_PULL_UP);

    CAN1->FMR |= CAN_FMR_FINIT;
    CAN1->FA1R = 0u;
    CAN1->FM1R |= 1u; /* bank 0: list of two identifiers, the same one twice */
    CAN1->FS1R |= 1u; /* of 32 bits */
    CAN1->F[0].FR1 = (uint32_t)IMPID_MESSAGES_COMMAND_FRAME_ID << CAN_RIR_STID_Pos;
    CAN1->F[0].FR2 = (uint32_t)IMPID_MESSAGES_COMMAND_FRAME_ID << CAN_RIR_STID_Pos;
    CAN1->FFA1R = 0u; /* to FIFO 0 */
    CAN1->FA1R = 1u;
    CAN1->FMR &= ~CAN_FMR_FINIT;

    CAN1->IER = CAN_IER_TMEIE | CAN_IER_FMPIE0 | CAN_IER_ERRIE | CAN_IER_BOFIE;
    interrupt_enable(IRQ_CAN1_RX0, PRIORITY_STAMP);
    interrupt_enable(IRQ_CAN1_TX, PRIORITY_TRANSMIT);
    interrupt_enable(IRQ_CAN1_SCE, PRIORITY_TRANSMIT);
    enter(0u);
}

/* --- Reception ----------------------------------------------------------------------------------- */

static uint8_t byte_of(uint32_t low, uint32_t high, uint32_t i) {
    return (uint8_t)((i < 4u ? low : high) >> (8u * (i % 4u)));
}

/* Hands the oldest message back. The controller does it in its own time and drops its line after that: to
 * return before would take the same message twice. */
static void release(void) {
    CAN1->RF0R = CAN_RF0R_RFOM;
    for (uint32_t i = 0; i < RELEASE_READS && (CAN1->RF0R & CAN_RF0R_RFOM) != 0u; i++) {
    }
}

/* One message each time: while another one waits the interrupt comes again by itself. */
void can1_rx0_handler(void) {
    uint32_t now_us = timebase_now_us();
    uint32_t state = CAN1->RF0R;
    if ((state & CAN_RF0R_FOVR) != 0u) {
        overruns++;
        CAN1->RF0R = CAN_RF0R_FOVR; /* by writing 1 */
    }
    if ((state & CAN_RF0R_FMP_Msk) == 0u) {
        return;
    }
    can_rx_regs_t *fifo = &CAN1->RX[0];
    uint32_t low = fifo->RDLR;
    uint32_t high = fifo->RDHR;
    if (arrived - taken < RECEIVE_FRAMES) {
        arrival_t *arrival = &arrivals[arrived % RECEIVE_FRAMES];
        arrival->t_us = now_us;
        arrival->frame.id = (uint16_t)(fifo->RIR >> CAN_RIR_STID_Pos);
        arrival->frame.dlc = (uint8_t)(fifo->RDTR & CAN_RDTR_DLC_Msk);
        for (uint32_t i = 0; i < sizeof arrival->frame.data; i++) {
            arrival->frame.data[i] = byte_of(low, high, i);
        }
        arrived++;
    } else {
        refused++; /* counted as rejected; its sender repeats it, unanswered */
    }
    release();
}

/* --- Loopback ------------------------------------------------------------------------------------ */

/* The only identifier that the filter lets pass, and bytes of which each frame has others. */
static impid_can_frame_t loop_frame(uint32_t number) {
    impid_can_frame_t frame = {.id = IMPID_MESSAGES_COMMAND_FRAME_ID, .dlc = 8u};
    for (uint32_t i = 0; i < sizeof frame.data; i++) {
        frame.data[i] = (uint8_t)((number + 1u) * (2u * i + 1u) * 41u);
    }
    return frame;
}

static void loop_receive(const impid_can_frame_t *frame) {
    impid_can_frame_t expected = loop_frame(loop.back);
    bool same = frame->id == expected.id && frame->dlc == expected.dlc &&
                memcmp(frame->data, expected.data, sizeof expected.data) == 0;
    loop.good += same ? 1u : 0u;
    loop.back++;
}

static void loop_on(void) {
    if (loop.wanted == 0u) {
        return;
    }
    if (loop.back == loop.wanted || timebase_now_us() - loop.began_us > LOOP_LIMIT_US) {
        loop.wanted = 0u;
        enter(0u);
    } else if (loop.back == loop.sent) {
        impid_can_frame_t frame = loop_frame(loop.sent);
        loop.sent += can_send(&frame) ? 1u : 0u;
    } else {
        /* the frame is on its way */
    }
}

bool can_loop_start(uint32_t frames) {
    if (frames == 0u || frames > LOOP_FRAMES_MAX || loop.wanted > 0u) {
        return false;
    }
    loop.wanted = frames;
    loop.sent = 0u;
    loop.back = 0u;
    loop.good = 0u;
    loop.began_us = timebase_now_us();
    enter(CAN_BTR_LBKM | CAN_BTR_SILM);
    return true;
}

uint32_t can_looped(void) {
    return loop.wanted > 0u ? UINT32_MAX : loop.good;
}

void can_poll(impid_core_t *core) {
    for (uint32_t i = 0; i < RECEIVE_FRAMES && taken != arrived; i++) {
        const arrival_t *arrival = &arrivals[taken % RECEIVE_FRAMES];
        if (loop.wanted > 0u) {
            loop_receive(&arrival->frame);
        } else {
            impid_core_can_receive(core, &arrival->frame, arrival->t_us);
        }
        taken++;
    }
    loop_on();
}

bool can_pending(void) {
    return taken != arrived;
}

/* --- Transmission -------------------------------------------------------------------------------- */

static uint32_t word_of(const uint8_t *bytes) {
    return (uint32_t)bytes[0] | ((uint32_t)bytes[1] << 8) | ((uint32_t)bytes[2] << 16) |
           ((uint32_t)bytes[3] << 24);
}

/* Interrupt, or main loop masked. TXFP keeps the mailboxes in the order of their requests. */
static void load_mailboxes(void) {
    for (uint32_t n = 0; n < MAILBOXES; n++) {
        if (loaded != queued && (CAN1->TSR & CAN_TSR_TME(n)) != 0u) {
            const impid_can_frame_t *frame = &waiting[loaded % TRANSMIT_FRAMES];
            can_tx_regs_t *mailbox = &CAN1->TX[n];
            mailbox->TDTR = frame->dlc;
            mailbox->TDLR = word_of(&frame->data[0]);
            mailbox->TDHR = word_of(&frame->data[4]);
            mailbox->TIR = ((uint32_t)frame->id << CAN_TIR_STID_Pos) | CAN_TIR_TXRQ;
            loaded++;
        }
    }
}

void can1_tx_handler(void) {
    CAN1->TSR = CAN_TSR_RQCP; /* by writing 1 */
    load_mailboxes();
}

bool can_send(const impid_can_frame_t *frame) {
    uint32_t place = queued;
    if (place - loaded >= TRANSMIT_FRAMES || (CAN1->ESR & CAN_ESR_BOFF) != 0u) {
        return false;
    }
    waiting[place % TRANSMIT_FRAMES] = *frame;
    uint32_t before = interrupts_mask();
    queued = place + 1u;
    load_mailboxes();
    interrupts_restore(before);
    return true;
}

uint32_t can_backlog_us(void) {
    uint32_t frames = queued - loaded;
    uint32_t empty = CAN1->TSR & CAN_TSR_TME_Msk;
    for (uint32_t n = 0; n < MAILBOXES; n++) {
        frames += (empty & CAN_TSR_TME(n)) == 0u ? 1u : 0u;
    }
    return frames * BITS_PER_FRAME * 1000u / kilobits;
}

/* --- Errors -------------------------------------------------------------------------------------- */

void can1_sce_handler(void) {
    if ((CAN1->ESR & CAN_ESR_BOFF) != 0u) {
        bus_off++;
    }
    CAN1->MSR = CAN_MSR_ERRI; /* by writing 1 */
    /* Read back: the bus is slower than the processor, and an interrupt whose flag is still on its way to
     * being cleared when the handler returns is entered again and counted twice. */
    (void)CAN1->MSR;
}

void can_health(impid_port_health_t *health) {
    uint32_t errors = CAN1->ESR;
    health->bus_off = bus_off;
    health->rejected = refused;
    health->can_overruns = overruns;
    health->tx_errors = (uint8_t)(errors >> CAN_ESR_TEC_Pos);
    health->rx_errors = (uint8_t)(errors >> CAN_ESR_REC_Pos);
}
