#include "can.h"

#include "board.h"
#include "clock.h"
#include "interrupts.h"
#include "pin.h"
#include "registers.h"
#include "timebase.h"

#include "impid_messages.h"

#define AF_FDCAN1       9u
#define TRANSMIT_FRAMES 64u /* a power of two */
#define RECEIVE_FRAMES  8u  /* a power of two */
#define BUFFERS         3u
#define INIT_ATTEMPTS   100000u
/* 16 quanta of 144 MHz / 9 / 16 = 1 Mbit/s; sample point (1 + 13) / 16 = 87.5 %. */
#define SEGMENT_1       13u
#define SEGMENT_2       2u
#define JUMP            2u
#define PRESCALER_AT_1M 9u
/* 8 data bytes: 111 bits, and at most 24 stuffed; these payloads average a few. */
#define BITS_PER_FRAME 117u

typedef struct {
    impid_can_frame_t frame;
    uint32_t t_us;
} arrival_t;

static impid_can_frame_t waiting[TRANSMIT_FRAMES];
static volatile uint32_t queued; /* main loop: frames ever queued */
static volatile uint32_t loaded; /* interrupt, or main loop masked: frames ever put into a buffer */

static arrival_t arrivals[RECEIVE_FRAMES];
static volatile uint32_t arrived;  /* interrupt */
static uint32_t taken;             /* main loop */
static volatile uint32_t refused;  /* interrupt: arrivals that found the queue full */
static volatile uint16_t overruns; /* interrupt: times the controller's own FIFO overflowed */

static uint32_t kilobits;
static volatile uint16_t bus_off;

static void set_bit_timing(uint32_t kbps) {
    uint32_t prescaler = PRESCALER_AT_1M * 1000u / kbps;
    FDCAN1->NBTP = ((JUMP - 1u) << FDCAN_NBTP_NSJW_Pos) | ((prescaler - 1u) << FDCAN_NBTP_NBRP_Pos) |
                   ((SEGMENT_1 - 1u) << FDCAN_NBTP_NTSEG1_Pos) | ((SEGMENT_2 - 1u) << FDCAN_NBTP_NTSEG2_Pos);
}

void can_start(uint32_t kbps) {
    kilobits = kbps;
    RCC->CCIPR |= RCC_CCIPR_FDCANSEL_PCLK;
    clock_enable(&RCC->APB1ENR1, RCC_APB1ENR1_FDCAN);
    pin_alternate(BOARD_CAN_TX, AF_FDCAN1, PIN_PULL_NONE);
    pin_alternate(BOARD_CAN_RX, AF_FDCAN1, PIN_PULL_UP);

    /* Bounded: without an answer the bus stays silent, and everything else still works. */
    FDCAN1->CCCR = FDCAN_CCCR_INIT;
    for (uint32_t i = 0; i < INIT_ATTEMPTS && (FDCAN1->CCCR & FDCAN_CCCR_INIT) == 0u; i++) {
    }
    FDCAN1->CCCR = FDCAN_CCCR_INIT | FDCAN_CCCR_CCE;
    set_bit_timing(kbps);
    /* One filter, of two identifiers that are the same; what it does not take is rejected. */
    FDCANRAM1->FILTER[0] = FDCAN_FILTER_TWO_IDS |
                           ((uint32_t)IMPID_MESSAGES_COMMAND_FRAME_ID << FDCAN_FILTER_ID1_Pos) |
                           (uint32_t)IMPID_MESSAGES_COMMAND_FRAME_ID;
    FDCAN1->RXGFC = FDCAN_RXGFC_REJECT | (1u << FDCAN_RXGFC_LSS_Pos);
    FDCAN1->TXBC = 0u; /* the buffers are a FIFO */
    FDCAN1->TXBTIE = FDCAN_TXBTIE_ALL;
    FDCAN1->ILS = FDCAN_ILS_SMSG | FDCAN_ILS_PERR;
    FDCAN1->IE = FDCAN_IE_RF0N | FDCAN_IE_RF0L | FDCAN_IE_TC | FDCAN_IE_BO;
    FDCAN1->ILE = FDCAN_ILE_BOTH;
    interrupt_enable(IRQ_FDCAN1_IT0, PRIORITY_STAMP);
    interrupt_enable(IRQ_FDCAN1_IT1, PRIORITY_TRANSMIT);
    /* Joins the bus once it has seen 11 recessive bits; nobody waits for that, as no bus may be there. */
    FDCAN1->CCCR = 0u;
}

/* --- Reception ----------------------------------------------------------------------------------- */

static uint8_t byte_of(uint32_t low, uint32_t high, uint32_t i) {
    return (uint8_t)((i < 4u ? low : high) >> (8u * (i % 4u)));
}

/* The oldest message of the controller's FIFO, and its place handed back. */
static void take_message(uint32_t now_us) {
    uint32_t place = (FDCAN1->RXF0S >> FDCAN_RXF0S_F0GI_Pos) & 3u;
    const fdcan_element_t *element = &FDCANRAM1->RX0[place];
    uint32_t low = element->DATA[0];
    uint32_t high = element->DATA[1];
    if (arrived - taken < RECEIVE_FRAMES) {
        arrival_t *arrival = &arrivals[arrived % RECEIVE_FRAMES];
        arrival->t_us = now_us;
        arrival->frame.id = (uint16_t)((element->ID >> FDCAN_ELEMENT_ID_Pos) & 0x7FFu);
        arrival->frame.dlc = (uint8_t)((element->LENGTH >> FDCAN_ELEMENT_DLC_Pos) & 15u);
        for (uint32_t i = 0; i < sizeof arrival->frame.data; i++) {
            arrival->frame.data[i] = byte_of(low, high, i);
        }
        arrived++;
    } else {
        refused++; /* counted as rejected; its sender repeats it, unanswered */
    }
    FDCAN1->RXF0A = place;
}

void fdcan1_it0_handler(void) {
    uint32_t now_us = timebase_now_us();
    if ((FDCAN1->IR & FDCAN_IR_RF0L) != 0u) {
        overruns++;
    }
    FDCAN1->IR = FDCAN_IR_RF0N | FDCAN_IR_RF0L; /* by writing 1 */
    /* Cleared before: a message that comes meanwhile raises it again. */
    for (uint32_t i = 0; i < BUFFERS && (FDCAN1->RXF0S & FDCAN_RXF0S_F0FL_Msk) != 0u; i++) {
        take_message(now_us);
    }
}

void can_poll(impid_core_t *core) {
    for (uint32_t i = 0; i < RECEIVE_FRAMES && taken != arrived; i++) {
        const arrival_t *arrival = &arrivals[taken % RECEIVE_FRAMES];
        impid_core_can_receive(core, &arrival->frame, arrival->t_us);
        taken++;
    }
}

bool can_pending(void) {
    return taken != arrived;
}

/* --- Transmission -------------------------------------------------------------------------------- */

static uint32_t word_of(const uint8_t *bytes) {
    return (uint32_t)bytes[0] | ((uint32_t)bytes[1] << 8) | ((uint32_t)bytes[2] << 16) |
           ((uint32_t)bytes[3] << 24);
}

/* Interrupt, or main loop masked. The FIFO keeps the order of the requests. */
static void load_buffers(void) {
    for (uint32_t n = 0; n < BUFFERS && loaded != queued && (FDCAN1->TXFQS & FDCAN_TXFQS_TFQF) == 0u; n++) {
        uint32_t place = (FDCAN1->TXFQS >> FDCAN_TXFQS_TFQPI_Pos) & 3u;
        const impid_can_frame_t *frame = &waiting[loaded % TRANSMIT_FRAMES];
        fdcan_element_t *element = &FDCANRAM1->TX[place];
        element->ID = (uint32_t)frame->id << FDCAN_ELEMENT_ID_Pos;
        element->LENGTH = (uint32_t)frame->dlc << FDCAN_ELEMENT_DLC_Pos;
        element->DATA[0] = word_of(&frame->data[0]);
        element->DATA[1] = word_of(&frame->data[4]);
        FDCAN1->TXBAR = 1u << place;
        loaded++;
    }
}

/* Off the bus the controller waits in initialisation until it is let out; then it counts 128 times 11
 * recessive bits by itself. */
void fdcan1_it1_handler(void) {
    uint32_t flags = FDCAN1->IR;
    FDCAN1->IR = FDCAN_IR_TC | FDCAN_IR_BO; /* by writing 1 */
    if ((flags & FDCAN_IR_BO) != 0u && (FDCAN1->PSR & FDCAN_PSR_BO) != 0u) {
        bus_off++;
        FDCAN1->CCCR = 0u;
    }
    load_buffers();
}

bool can_send(const impid_can_frame_t *frame) {
    uint32_t place = queued;
    if (place - loaded >= TRANSMIT_FRAMES || (FDCAN1->PSR & FDCAN_PSR_BO) != 0u) {
        return false;
    }
    waiting[place % TRANSMIT_FRAMES] = *frame;
    uint32_t before = interrupts_mask();
    queued = place + 1u;
    load_buffers();
    interrupts_restore(before);
    return true;
}

uint32_t can_backlog_us(void) {
    uint32_t frames = queued - loaded + BUFFERS - (FDCAN1->TXFQS & FDCAN_TXFQS_TFFL_Msk);
    return frames * BITS_PER_FRAME * 1000u / kilobits;
}

/* --- Errors -------------------------------------------------------------------------------------- */

void can_health(impid_port_health_t *health) {
    uint32_t errors = FDCAN1->ECR;
    health->bus_off = bus_off;
    health->rejected = refused;
    health->can_overruns = overruns;
    health->tx_errors = (uint8_t)(errors >> FDCAN_ECR_TEC_Pos);
    health->rx_errors = (uint8_t)((errors >> FDCAN_ECR_REC_Pos) & 127u);
}
