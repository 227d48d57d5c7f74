/* What a chip's converters and encoder latches do for sampling.c. */
#ifndef CONVERTERS_H
#define CONVERTERS_H

#include "impid_core.h"

#define CONVERSIONS (2u * IMPID_OVERSAMPLING) /* two halves */

/* Written by DMA. The word that both converters make of one trigger has x in its low half: x comes first. */
typedef struct {
    volatile uint16_t codes[CONVERSIONS][2] __attribute__((aligned(4)));
    volatile uint32_t latched[2][CONVERSIONS];
} conversions_t;

/* Before all else: the sum of so many readings of the internal reference. */
uint32_t converters_reference(uint32_t readings);
/* From here on each trigger of TIM3 fills a row; the tick interrupt comes at each half. */
void converters_start(conversions_t *to);
/* In the tick interrupt, whose flags this takes. false: a transfer has failed. */
bool converters_well(void);
/* The transfers count the same triggers, the encoders' being at most a trigger ahead of the conversion under
 * way. If they ever differ by more, counts and conversions no longer belong together. */
bool converters_in_step(void);
/* One reading of the reference between two triggers: begun, and later there or not. */
void converters_take_reference(void);
bool converters_reference_taken(uint32_t *code);

#endif
