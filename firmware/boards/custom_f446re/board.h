/* An STM32F446RE on a board of one's own: a crystal instead of the ST-LINK's clock, other pins for the
 * accelerometer, CAN and the LED. This file is all that such a board needs, and an
 * environment in platformio.ini that names its folder. */
#ifndef BOARD_H
#define BOARD_H

#include "pin.h"

#define BOARD_ID 0x701DFFD1u /* CRC-32 of "custom_f446re" */

#define BOARD_SENSOR  impid_adxl203
#define BOARD_DIGITAL false /* its outputs are voltages */

#define BOARD_HSE_MHZ    8u
#define BOARD_HSE_BYPASS false /* a crystal */

#define BOARD_ACCEL_X       PIN(GPIOC, 2)
#define BOARD_ACCEL_Y       PIN(GPIOC, 3)
#define BOARD_ADC_X_CHANNEL 12u
#define BOARD_ADC_Y_CHANNEL 13u
#define BOARD_SELF_TEST     PIN(GPIOB, 5)

#define BOARD_ENCODER_1_A     PIN(GPIOA, 15) /* TIM2_CH1; PA5 has it too, but is not 5 V tolerant */
#define BOARD_ENCODER_1_B     PIN(GPIOB, 3)  /* TIM2_CH2 */
#define BOARD_ENCODER_2_A     PIN(GPIOA, 0)  /* TIM5_CH1 */
#define BOARD_ENCODER_2_B     PIN(GPIOA, 1)  /* TIM5_CH2 */
#define BOARD_ENCODER_1_FAULT PIN(GPIOB, 10)
#define BOARD_ENCODER_2_FAULT PIN(GPIOA, 8)

#define BOARD_SYNC      PIN(GPIOB, 6) /* TIM4_CH1 */
#define BOARD_SERIAL_TX PIN(GPIOA, 2) /* USART2 */
#define BOARD_SERIAL_RX PIN(GPIOA, 3)
#define BOARD_CAN_RX    PIN(GPIOA, 11) /* CAN1 */
#define BOARD_CAN_TX    PIN(GPIOA, 12)
#define BOARD_EDGE      PIN(GPIOA, 6) /* TIM3_CH1: the bench test's wire begins here */
#define BOARD_LED       PIN(GPIOB, 12)

#endif
