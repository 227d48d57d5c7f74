/* Which sources and which compiler made this binary, so that a recording names what recorded it.
 *
 * Data flow: the build writes impid_build_id.h (firmware/pio/image.py); without it, as in a source tree that
 * is no checkout, the commit is 0 and not known. To be included where the board fills its configuration in,
 * and nowhere else: what includes it is compiled anew with every commit. Ownership, timing: constants. Can
 * fail: no.
 */
#ifndef IMPID_BUILD_H
#define IMPID_BUILD_H

#if defined(__has_include)
#if __has_include("impid_build_id.h")
#include "impid_build_id.h"
#endif
#endif

#ifndef IMPID_BUILD_COMMIT
#define IMPID_BUILD_COMMIT 0u /* the first eight digits of the commit's hash */
#define IMPID_BUILD_SOURCE 0u /* bit 0: the sources differed from it; bit 1: it is known */
#endif

#ifdef __clang__
#define IMPID_BUILD_COMPILER                                                                                 \
    (4u | ((uint32_t)__clang_major__ << 24) | ((uint32_t)__clang_minor__ << 16) |                            \
     ((uint32_t)__clang_patchlevel__ << 8))
#else
#define IMPID_BUILD_COMPILER                                                                                 \
    (((uint32_t)__GNUC__ << 24) | ((uint32_t)__GNUC_MINOR__ << 16) | ((uint32_t)__GNUC_PATCHLEVEL__ << 8))
#endif

/* Compiler's version from bit 31 on, a byte each for major, minor and patch; bit 2: clang, else gcc; bits 1
 * and 0 as above. */
#define IMPID_BUILD_STATE (IMPID_BUILD_COMPILER | IMPID_BUILD_SOURCE)

#endif
