/* ST Nucleo-G474RE with the wiring of docs/hardware.md. Alternate functions: STM32G474xB/C/E data sheet,
 * table "Alternate function". PB8 is left alone: its level at reset chooses what the chip boots from, and a
 * CAN transceiver's output is high at rest.
 */
#ifndef BOARD_H
#define BOARD_H

#include "pin.h"

#define BOARD_ID 0xA0D8BFBEu /* CRC-32 of "nucleo_g474re" */

#define BOARD_SENSOR  impid_adxl203_oversampled
#define BOARD_DIGITAL false /* its outputs are voltages */

#define BOARD_HSE_MHZ    24u
#define BOARD_HSE_BYPASS false /* a crystal */

#define BOARD_ACCEL_X       PIN(GPIOC, 0) /* A5 */
#define BOARD_ACCEL_Y       PIN(GPIOC, 1) /* A4 */
#define BOARD_ADC_X_CHANNEL 6u
#define BOARD_ADC_Y_CHANNEL 7u
#define BOARD_SELF_TEST     PIN(GPIOB, 5) /* D4 */

#define BOARD_ENCODER_1_A     PIN(GPIOA, 15) /* CN7-17, TIM2_CH1 */
#define BOARD_ENCODER_1_B     PIN(GPIOB, 3)  /* D3, TIM2_CH2 */
#define BOARD_ENCODER_2_A     PIN(GPIOA, 0)  /* A0, TIM5_CH1 */
#define BOARD_ENCODER_2_B     PIN(GPIOA, 1)  /* A1, TIM5_CH2 */
#define BOARD_ENCODER_1_FAULT PIN(GPIOA, 10) /* D2, low: fault */
#define BOARD_ENCODER_2_FAULT PIN(GPIOA, 8)  /* D7, low: fault */

#define BOARD_SYNC      PIN(GPIOB, 6) /* D10, TIM4_CH1 */
#define BOARD_SERIAL_TX PIN(GPIOA, 2) /* to the ST-LINK, USART2 */
#define BOARD_SERIAL_RX PIN(GPIOA, 3)
#define BOARD_CAN_RX    PIN(GPIOA, 11) /* CN10-14, FDCAN1 */
#define BOARD_CAN_TX    PIN(GPIOA, 12) /* CN10-12, FDCAN1 */
#define BOARD_LED       PIN(GPIOA, 5)  /* LD2 */
#define BOARD_EDGE      PIN(GPIOA, 6)  /* D12, TIM3_CH1: where the bench test's wire begins */

#endif
