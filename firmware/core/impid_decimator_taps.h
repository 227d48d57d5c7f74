/* Written by scripts/design_decimator.py: change the design there.
 *
 * Equiripple low-pass, 28 taps at 8000 Hz, symmetric, gain at DC exactly 1
 * (sum 2^16); -0.025 dB at 60 Hz,
 * -57.0 dB at 940 Hz and less above.
 */
/* clang-format off */
#ifndef IMPID_DECIMATOR_TAPS_H
#define IMPID_DECIMATOR_TAPS_H

#define IMPID_DECIMATOR_TAPS 28u
#define IMPID_DECIMATOR_SCALE_BITS 16
#define IMPID_DECIMATOR_TAP_VALUES \
     -133,  -248,  -401,  -518,  -518,  -305,   206, \
     1062,  2248,  3676,  5190,  6589,  7667,  8253, \
     8253,  7667,  6589,  5190,  3676,  2248,  1062, \
      206,  -305,  -518,  -518,  -401,  -248,  -133

#endif
