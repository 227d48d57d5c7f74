/* What must hold whatever comes in from outside: if it does not, this program is wrong, and no answer of it
 * can be trusted any more.
 *
 * On a chip the board records the place and resets: the fault is in LOG, the samples of the next boot are
 * marked. On a PC the board, the tests and the fuzz targets abort, saying what did not hold: a fuzzer takes
 * that for a find. Bad input is no matter of this: it is refused and counted.
 * Not for the loader, which calls nothing outside of itself. Timing: one comparison.
 */
#ifndef IMPID_ASSERT_H
#define IMPID_ASSERT_H

#include <stddef.h>

/* The board's. `what` is the condition, NULL on a chip, where the place says it. */
_Noreturn void impid_assert_failed(const char *what);

#ifdef __arm__
#define IMPID_ASSERT_TEXT(condition) NULL
#else
#define IMPID_ASSERT_TEXT(condition) #condition
#endif

#define IMPID_ASSERT(condition)                                                                              \
    do {                                                                                                     \
        if (!(condition)) {                                                                                  \
            impid_assert_failed(IMPID_ASSERT_TEXT(condition));                                               \
        }                                                                                                    \
    } while (0)

#endif
