/* Registers of bxCAN and their bits (30.9), for both halves of its model. */
#ifndef CAN_BITS_H
#define CAN_BITS_H

#include "chip.h"

enum { MCR = 0, MSR = 1, TSR = 2, RF0R = 3, IER = 5, ESR = 6, BTR = 7 };
enum { FMR = 0x200 / 4, FM1R = 0x204 / 4, FS1R = 0x20C / 4, FFA1R = 0x214 / 4, FA1R = 0x21C / 4 };
enum { TXFP = 1 << 2, RFLM = 1 << 3, NART = 1 << 4, ABOM = 1 << 6 };
enum { LBKM = 1 << 30 };
enum { INAK = 1, SLAK = 2, ERRI = 1 << 2 };
enum { TMEIE = 1, FMPIE0 = 1 << 1, FFIE0 = 1 << 2, FOVIE0 = 1 << 3 };
enum { EWGIE = 1 << 8, EPVIE = 1 << 9, BOFIE = 1 << 10, LECIE = 1 << 11, ERRIE = 1 << 15 };
enum { EWGF = 1, EPVF = 2, BOFF = 4, TXRQ = 1, RTR = 2, IDE = 4 };
enum { LEC_ACK = 3, LEC_BIT_RECESSIVE = 4, WARNING = 96, PASSIVE = 128, BUS_OFF = 256 };
enum { MAILBOXES = 3, FIFO_DEPTH = 3, BANKS = 28, IRQ_TX = 19, IRQ_SCE = 22 };
enum { TRANSMIT_AT = 0x180, RECEIVE_AT = 0x1B0, FILTERS_AT = 0x240 };

/* A mailbox is empty again; `status`: its four bits of TSR. */
void can_release(can *n, uint32_t box, uint32_t status);

#endif
