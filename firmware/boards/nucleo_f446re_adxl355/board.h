/* ST Nucleo-F446RE with an ADXL355 over SPI in place of the ADXL203, wired as docs/hardware.md says. The
 * converters go on as the clock of the ticks and measure the supply; what PC0 and PC1 show is thrown away.
 */
#ifndef BOARD_H
#define BOARD_H

#include "pin.h"

#define BOARD_ID 0x148BFAB8u /* CRC-32 of "nucleo_f446re_adxl355" */

#define BOARD_SENSOR  impid_adxl355
#define BOARD_DIGITAL true

#define BOARD_HSE_MHZ    8u   /* from the ST-LINK, */
#define BOARD_HSE_BYPASS true /* a clock signal, not a crystal */

#define BOARD_ACCEL_X       PIN(GPIOC, 0) /* A5, open */
#define BOARD_ACCEL_Y       PIN(GPIOC, 1) /* A4, open */
#define BOARD_ADC_X_CHANNEL 10u
#define BOARD_ADC_Y_CHANNEL 11u
#define BOARD_SELF_TEST     PIN(GPIOB, 5) /* D4, unused */

#define BOARD_SPI_CS   PIN(GPIOB, 12) /* CN10-16 */
#define BOARD_SPI_SCK  PIN(GPIOB, 13) /* CN10-30, SPI2 */
#define BOARD_SPI_MISO PIN(GPIOB, 14) /* CN10-28, SPI2 */
#define BOARD_SPI_MOSI PIN(GPIOB, 15) /* CN10-26, SPI2 */
#define BOARD_SPI_SYNC PIN(GPIOA, 9)  /* D8, TIM1_CH2: to the sensor's SYNC (INT2) */

#define BOARD_ENCODER_1_A     PIN(GPIOA, 15) /* CN7-17, TIM2_CH1 */
#define BOARD_ENCODER_1_B     PIN(GPIOB, 3)  /* D3, TIM2_CH2 */
#define BOARD_ENCODER_2_A     PIN(GPIOA, 0)  /* A0, TIM5_CH1 */
#define BOARD_ENCODER_2_B     PIN(GPIOA, 1)  /* A1, TIM5_CH2 */
#define BOARD_ENCODER_1_FAULT PIN(GPIOB, 10) /* D6, low: fault */
#define BOARD_ENCODER_2_FAULT PIN(GPIOA, 8)  /* D7, low: fault */

#define BOARD_SYNC      PIN(GPIOB, 6) /* D10, TIM4_CH1 */
#define BOARD_SERIAL_TX PIN(GPIOA, 2) /* to the ST-LINK, USART2 */
#define BOARD_SERIAL_RX PIN(GPIOA, 3)
#define BOARD_CAN_RX    PIN(GPIOB, 8) /* D15, CAN1 */
#define BOARD_CAN_TX    PIN(GPIOB, 9) /* D14, CAN1 */
#define BOARD_EDGE      PIN(GPIOA, 6) /* D12, TIM3_CH1: the bench test's wire begins here */
#define BOARD_LED       PIN(GPIOA, 5) /* LD2 */

#endif
