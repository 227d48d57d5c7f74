#include "inputs.h"

#include "board.h"
#include "pin.h"

enum { AF_TIM2 = 1, AF_TIM4 = 2, AF_TIM5 = 2 };

static pin_pull_t pull(const impid_settings_t *settings, impid_setting_t setting, pin_pull_t direction) {
    return settings->values[setting] != 0u ? direction : PIN_PULL_NONE;
}

void inputs_start(const impid_settings_t *settings) {
    pin_pull_t encoder_1 = pull(settings, IMPID_SETTING_ENCODER_1_PULL, PIN_PULL_UP);
    pin_pull_t encoder_2 = pull(settings, IMPID_SETTING_ENCODER_2_PULL, PIN_PULL_UP);
    pin_alternate(BOARD_ENCODER_1_A, AF_TIM2, encoder_1);
    pin_alternate(BOARD_ENCODER_1_B, AF_TIM2, encoder_1);
    pin_alternate(BOARD_ENCODER_2_A, AF_TIM5, encoder_2);
    pin_alternate(BOARD_ENCODER_2_B, AF_TIM5, encoder_2);
    pin_input(BOARD_ENCODER_1_FAULT, pull(settings, IMPID_SETTING_FAULT_1_PULL, PIN_PULL_UP));
    pin_input(BOARD_ENCODER_2_FAULT, pull(settings, IMPID_SETTING_FAULT_2_PULL, PIN_PULL_UP));
    pin_alternate(BOARD_SYNC, AF_TIM4, pull(settings, IMPID_SETTING_SYNC_PULL, PIN_PULL_DOWN));
}

static pin_pull_t towards(uint32_t levels, uint32_t line) {
    return ((levels >> line) & 1u) != 0u ? PIN_PULL_UP : PIN_PULL_DOWN;
}

void inputs_hold(uint32_t levels) {
    pin_alternate(BOARD_ENCODER_1_A, AF_TIM2, towards(levels, 0u));
    pin_alternate(BOARD_ENCODER_1_B, AF_TIM2, towards(levels, 1u));
    pin_alternate(BOARD_ENCODER_2_A, AF_TIM5, towards(levels, 2u));
    pin_alternate(BOARD_ENCODER_2_B, AF_TIM5, towards(levels, 3u));
}
