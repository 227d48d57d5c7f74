/* Conversions of ADC1 and ADC2 (chapter 13); what may be configured is adc.py's. */
#include "chip.h"

#include <stdio.h>

enum { SR = 0, CR1 = 1, CR2 = 2, SMPR1 = 3, SMPR2 = 4, SQR3 = 13, JSQR = 14, JDR1 = 15, DR = 19 };
enum { CSR, CCR, CDR };
enum {
    EOC = 1 << 1,
    JEOC = 1 << 2,
    JSTRT = 1 << 3,
    STRT = 1 << 4,
    OVR = 1 << 5,
    EOCIE = 1 << 5,
    OVRIE = 1 << 26
};
enum { ADON = 1, DMA = 1 << 8, DDS = 1 << 9, EOCS = 1 << 10 };
enum {
    CCR_DDS = 1 << 13,
    TSVREFE = 1 << 23,
    SIMULTANEOUS = 6,
    BOTH_SIMULTANEOUS = 1,
    ADC_IRQ = 18,
    CONVERSION_CYCLES = 12
};
static const uint32_t SAMPLE_CYCLES[8] = {3, 15, 28, 56, 84, 112, 144, 480}; /* 13.13.4 */
static const double MAX_CLOCK_HZ = 36e6;         /* data sheet, ADC characteristics, VDDA above 2.4 V */
static const double INTERNAL_SAMPLING_S = 10e-6; /* data sheet, embedded reference and temperature sensor */

static uint32_t channel_of(const adc *a, uint32_t unit) {
    return a->reg[unit][SQR3] & 0x1Fu;
}

static uint32_t sample_cycles(const adc *a, uint32_t unit, uint32_t channel) {
    const uint32_t code =
        channel >= 10 ? a->reg[unit][SMPR1] >> 3 * (channel - 10) : a->reg[unit][SMPR2] >> 3 * channel;
    return SAMPLE_CYCLES[code & 7u];
}

/* HCLK over the ADC clock: PCLK2 divided by ADCPRE (13.13.16). */
uint32_t adc_clock_divider(adc *a) {
    const uint32_t divider = a->bank.chip->apb2 * 2u * ((a->common[CCR] >> 16 & 3u) + 1u);
    if (a->bank.chip->frequency / divider > MAX_CLOCK_HZ) {
        chip_violate(a->bank.chip, "ADC", "13.13.16", "the ADC clock is above 36 MHz");
    }
    return divider;
}

/* From the trigger to the instant whose voltage counts: the end of sampling. */
double adc_held_after_s(adc *a, uint32_t channel) {
    const uint32_t unit = channel == channel_of(a, 0) ? 0 : 1;
    return sample_cycles(a, unit, channel) * adc_clock_divider(a) / a->bank.chip->frequency;
}

void adc_update_line(adc *a) {
    int high = 0;
    for (int n = 0; n < 2; ++n) {
        const uint32_t status = a->reg[n][SR];
        const uint32_t enables = a->reg[n][CR1];
        high = high || ((status & EOC) != 0 && (enables & EOCIE) != 0) ||
               ((status & OVR) != 0 && (enables & OVRIE) != 0);
    }
    nvic_set_line(a->bank.chip, ADC_IRQ, high);
}

uint32_t adc_read_dr(adc *a, uint32_t unit) {
    a->reg[unit][SR] &= ~(uint32_t)EOC;
    adc_update_line(a);
    return a->reg[unit][DR];
}

/* Both results; reading clears EOC of both. */
uint32_t adc_read_cdr(adc *a) {
    a->reg[0][SR] &= ~(uint32_t)EOC;
    a->reg[1][SR] &= ~(uint32_t)EOC;
    return a->common[CDR];
}

/* --- conversions --------------------------------------------------------------------------------- */

/* Channels 0 to 7 on port A, 8 and 9 on B, 10 to 15 on C (data sheet, pin definitions). */
static int analogue(const chip *c, uint32_t channel) {
    const gpio *port = c->gpios[channel < 8 ? GPIO_A : channel < 10 ? GPIO_B : GPIO_C];
    const uint32_t pin = channel < 8 ? channel : channel < 10 ? channel - 8 : channel - 10;
    return (port->reg[0] >> 2 * pin & 3u) == 3u;
}

static uint32_t convert(adc *a, uint32_t channel) {
    chip *c = a->bank.chip;
    for (uint32_t axis = 0; axis < 2 && c->world != NULL; ++axis) {
        if (c->world->channels[axis] == (int32_t)channel && analogue(c, channel)) {
            return world_code(c->world, schedule_seconds(c) + adc_held_after_s(a, channel), axis);
        }
    }
    return chip_source(c, channel);
}

/* After the DMA's last transfer, circular or not, a converter without DDS asks no more (13.8.1). */
static void request(adc *a, int endless) {
    chip *c = a->bank.chip;
    if (dma_request(c, REQUEST_ADC1) && !endless && c->dmas[DMA_2]->streams[0].block_ended) {
        a->requests_over = 1;
    }
}

/* Results, EOC, DMA request; a result that was not fetched in time is an overrun (13.8.2). */
static void finish(chip *c, void *owner, uint64_t detail) {
    adc *a = owner;
    uint32_t *master = a->reg[a->master];
    (void)c;
    (void)detail;
    const uint32_t enabled = a->both ? a->common[CCR] >> 14 & 3u : master[CR2] & DMA;
    const int uses_dma = enabled != 0 && !a->requests_over;
    if ((uses_dma || (master[CR2] & EOCS) != 0) && (master[SR] & EOC) != 0) {
        master[SR] |= OVR;
        a->overrun = (uint32_t)uses_dma;
    }
    if (a->overrun && (master[SR] & OVR) != 0) {
        adc_update_line(a);
        return; /* no more requests until OVR is cleared */
    }
    a->overrun = 0;
    master[DR] = a->first;
    master[SR] |= EOC;
    if (a->both) {
        a->reg[1][DR] = a->second;
        a->reg[1][SR] |= EOC;
        a->common[CDR] = a->second << 16 | a->first;
    }
    if (uses_dma) {
        request(a, a->both ? (a->common[CCR] & CCR_DDS) != 0 : (master[CR2] & DDS) != 0);
    }
    adc_update_line(a);
}

/* Both convert together. */
static int dual(const adc *a) {
    const uint32_t mode = a->common[CCR] & 0x1Fu;
    return mode == SIMULTANEOUS || mode == BOTH_SIMULTANEOUS;
}

/* The internal channels need their switch and their time (13.10). */
static void check_internal(adc *a, uint32_t unit, uint32_t channel) {
    chip *c = a->bank.chip;
    char text[80];
    if (channel != 17 && channel != 18) {
        return;
    }
    if ((a->common[CCR] & TSVREFE) == 0) {
        (void)snprintf(text, sizeof text, "internal channel %u converted while TSVREFE is 0", channel);
        chip_violate(c, "ADC", "13.10", text);
    } else if (sample_cycles(a, unit, channel) * adc_clock_divider(a) / c->frequency < INTERNAL_SAMPLING_S) {
        (void)snprintf(text, sizeof text, "internal channel %u sampled for less than 10 us", channel);
        chip_violate(c, "ADC", "13.10", text);
    }
}

/* Samples now; the result comes after sampling and conversion. A trigger meanwhile is ignored. */
void adc_start(adc *a, uint32_t master) {
    chip *c = a->bank.chip;
    const int both = dual(a) && master == 0;
    const uint32_t channel = channel_of(a, master);
    const uint32_t cycles = sample_cycles(a, master, channel);
    if (c->now < a->injected_until) {
        chip_violate(c, "ADC", "13.3.9", "a trigger during an injected conversion: the sample is late");
        return;
    }
    if (c->now < a->busy_until) {
        return;
    }
    check_internal(a, master, channel);
    if (both && (a->reg[1][CR2] & ADON) == 0) {
        chip_violate(c, "ADC", "13.9", "dual mode with ADC2 off");
    } else if (both && cycles != sample_cycles(a, 1, channel_of(a, 1))) {
        chip_violate(c, "ADC", "13.9.2", "simultaneous conversions of different length");
    }
    if (c->failed) {
        return;
    }
    a->busy_until = c->now + (uint64_t)(cycles + CONVERSION_CYCLES) * adc_clock_divider(a);
    a->reg[master][SR] |= STRT;
    a->master = master;
    a->both = (uint32_t)both;
    a->first = convert(a, channel);
    a->second = both ? convert(a, channel_of(a, 1)) : 0;
    (void)schedule_at(c, a->busy_until, finish, a, 0);
}

/* --- injected conversions ------------------------------------------------------------------------ */

/* detail: the unit, and above its lowest bit the result. */
static void finish_injected(chip *c, void *owner, uint64_t detail) {
    adc *a = owner;
    uint32_t *reg = a->reg[detail & 1u];
    (void)c;
    reg[JDR1] = (uint32_t)(detail >> 1);
    reg[SR] |= JEOC;
}

/* Samples now; in dual mode both do, and each has its own length. */
void adc_start_injected(adc *a, uint32_t master) {
    chip *c = a->bank.chip;
    if (c->now < a->busy_until || c->now < a->injected_until) {
        chip_violate(c, "ADC", "13.3.9", "an injected conversion during another");
        return;
    }
    if ((a->common[CCR] & 0x1Fu) == SIMULTANEOUS) {
        chip_violate(c, "ADC", "13.9.2", "an injected conversion in regular simultaneous mode");
        return;
    }
    for (uint32_t unit = dual(a) ? 0 : master; unit < (dual(a) ? 2u : master + 1u); ++unit) {
        const uint32_t channel = a->reg[unit][JSQR] >> 15 & 0x1Fu;
        check_internal(a, unit, channel);
        const uint64_t length =
            (uint64_t)(sample_cycles(a, unit, channel) + CONVERSION_CYCLES) * adc_clock_divider(a);
        a->injected_until = c->now + length > a->injected_until ? c->now + length : a->injected_until;
        a->reg[unit][SR] |= JSTRT;
        (void)schedule_at(c, c->now + length, finish_injected, a, (uint64_t)convert(a, channel) << 1 | unit);
    }
}

/* A timer's TRGO rises. */
void adc_trigger(adc *a, int32_t number) {
    if (a->trigger == number) {
        adc_start(a, 0);
    }
}

static int read(bank *b, uint32_t offset, uint32_t size, uint32_t *value) {
    adc *a = (adc *)b;
    if (size != 4 || offset != 0x300 + 4 * CDR) {
        return 0;
    }
    *value = adc_read_cdr(a);
    return 1;
}

static int write(bank *b, uint32_t offset, uint32_t size, uint32_t value) {
    (void)b;
    (void)offset;
    (void)size;
    (void)value;
    return 0;
}

void adc_bind(adc *a) {
    a->bank.read = read;
    a->bank.write = write;
}
