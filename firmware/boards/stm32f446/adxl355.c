#include "adxl355.h"

#include "board.h"
#include "clock.h"
#include "pin.h"
#include "registers.h"

#ifdef BOARD_SPI_CS /* a board with the sensor */

enum { AF_SPI2 = 5, AF_TIM1 = 1 };

/* TIM1 counts microseconds; SYNC is high from here to the end of the millisecond. */
#define SYNC_AT_US 780u
/* A byte takes 128 cycles of the processor, a turn of the loop six or more. */
#define ATTEMPTS 64u

enum {
    PARTID = 0x02, /* then REVID, STATUS, FIFO_ENTRIES, TEMP2, TEMP1, and three bytes for each axis */
    FILTER = 0x28,
    SYNC = 0x2B,
    RANGE = 0x2C,
    POWER_CTL = 0x2D,
    SELF_TEST = 0x2E
};
enum {
    IDENTITY = 0xED,
    STATUS_DATA_RDY = 0x01,
    FILTER_1000_HZ = 0x02,
    SYNC_EXTERNAL_INTERPOLATED = 0x02,
    RANGE_2_G = 0x81, /* as after reset, I2C speed bit included */
    POWER_STANDBY = 0x01,
    POWER_MEASURE = 0x00,
    SELF_TEST_ON = 0x03 /* ST1: the mode, ST2: the force */
};
enum { AT_PARTID = 0, AT_STATUS = 2, AT_AXES = 6, BYTES = 15 };

/* Of the tick alone. */
static bool set_up;
static bool self_test_set;
/* Written by the main loop, read by the tick. */
static volatile bool self_test_wanted;

static uint8_t exchange(uint8_t byte) {
    SPI2->DR = byte;
    for (uint32_t i = 0; i < ATTEMPTS && (SPI2->SR & SPI_SR_RXNE) == 0u; i++) {
    }
    return (uint8_t)SPI2->DR;
}

static void write_register(uint8_t address, uint8_t value) {
    pin_write(BOARD_SPI_CS, false);
    (void)exchange((uint8_t)(address << 1));
    (void)exchange(value);
    pin_write(BOARD_SPI_CS, true);
}

static void read_registers(uint8_t first, uint8_t *bytes, uint32_t count) {
    pin_write(BOARD_SPI_CS, false);
    (void)exchange((uint8_t)((uint32_t)first << 1 | 1u));
    for (uint32_t i = 0; i < count; i++) {
        bytes[i] = exchange(0u);
    }
    pin_write(BOARD_SPI_CS, true);
}

/* The settings may change in standby only. */
static void configure(void) {
    write_register(POWER_CTL, POWER_STANDBY);
    write_register(RANGE, RANGE_2_G);
    write_register(FILTER, FILTER_1000_HZ);
    write_register(SYNC, SYNC_EXTERNAL_INTERPOLATED);
    write_register(SELF_TEST, 0u);
    write_register(POWER_CTL, POWER_MEASURE);
    self_test_set = false;
}

void adxl355_start(void) {
    clock_enable(&RCC->APB1ENR, RCC_APB1ENR_SPI2);
    clock_enable(&RCC->APB2ENR, RCC_APB2ENR_TIM1);
    pin_output(BOARD_SPI_CS);
    pin_write(BOARD_SPI_CS, true);
    pin_alternate(BOARD_SPI_SCK, AF_SPI2, PIN_PULL_NONE);
    /* Without a sensor all bits are 0, and so is the part's number. */
    pin_alternate(BOARD_SPI_MISO, AF_SPI2, PIN_PULL_DOWN);
    pin_alternate(BOARD_SPI_MOSI, AF_SPI2, PIN_PULL_NONE);
    pin_alternate(BOARD_SPI_SYNC, AF_TIM1, PIN_PULL_NONE);

    /* Mode 0, 45 / 8 MHz, of the 10 that the sensor takes. */
    SPI2->CR1 = SPI_CR1_MSTR | SPI_CR1_BR_8 | SPI_CR1_SSM | SPI_CR1_SSI;
    SPI2->CR1 |= SPI_CR1_SPE;

    TIM1->PSC = CLOCK_TIMER_HZ / 1000000u - 1u;
    TIM1->ARR = 1000u - 1u;
    TIM1->CCR2 = SYNC_AT_US;
    TIM1->CCMR1 = TIM1_CCMR1_OC2M_PWM2; /* high from the match on */
    TIM1->CCER = TIM1_CCER_CC2E;
    TIM1->BDTR = TIM1_BDTR_MOE;
    TIM1->EGR = TIM_EGR_UG;                                 /* the prescaler into force */
    TIM1->SMCR = TIM_SMCR_TS_ITR(3) | TIM_SMCR_SMS_TRIGGER; /* ITR3 = TIM4, as of TIM3 */
}

void adxl355_read(uint32_t reading[]) {
    uint8_t bytes[BYTES];
    for (uint32_t axis = 0; axis < 3u; axis++) {
        reading[axis] = 0u;
    }
    if (!set_up) {
        configure();
        read_registers(PARTID, bytes, BYTES);
        set_up = bytes[AT_PARTID] == (uint8_t)IDENTITY;
        return; /* what it held is older than its settings */
    }
    bool wanted = self_test_wanted;
    if (wanted != self_test_set) {
        write_register(SELF_TEST, wanted ? (uint8_t)SELF_TEST_ON : 0u);
        self_test_set = wanted;
    }
    read_registers(PARTID, bytes, BYTES);
    set_up = bytes[AT_PARTID] == (uint8_t)IDENTITY;
    if (!set_up || (bytes[AT_STATUS] & (uint8_t)STATUS_DATA_RDY) == 0u) {
        return;
    }
    for (uint32_t axis = 0; axis < 3u; axis++) {
        const uint8_t *data = &bytes[(uint32_t)AT_AXES + 3u * axis];
        uint32_t code = ((uint32_t)data[0] << 12) | ((uint32_t)data[1] << 4) | ((uint32_t)data[2] >> 4);
        reading[axis] = code ^ 0x80000u; /* two's complement to offset binary */
    }
}

void adxl355_self_test(bool on) {
    self_test_wanted = on;
}

#endif
