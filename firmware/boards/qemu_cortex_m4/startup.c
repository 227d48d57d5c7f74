/* From reset into newlib's own start-up, whose files and exit are the emulator's (semihosting). */
#include <stdint.h>
#include <stdlib.h>

extern uint32_t linker_stack_top[];
/* newlib's: sets up memory by asking the emulator, then runs main() and exit(). */
void _start(void);

/* A test that crashes must not look like one that passed: leaves with a status, by a call that needs no stack
 * (Arm semihosting, SYS_EXIT 0x18 with any reason but "application exit"). */
__attribute__((naked)) static void fault_handler(void) {
    __asm volatile("movs r0, #0x18\n\t"
                   "ldr r1, =0x20023\n\t"
                   "bkpt 0xab\n\t"
                   "b .\n");
}

typedef void (*handler_t)(void);

__attribute__((section(".vectors"), used)) static const struct {
    uint32_t *stack_top;
    handler_t reset;
    handler_t others[14];
} vectors = {
    .stack_top = linker_stack_top,
    .reset = _start,
    .others = {[0 ... 13] = fault_handler},
};
