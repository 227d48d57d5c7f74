"""Design the decimation filter and write firmware/core/impid_decimator_taps.h (`--check`: compare only).

28 taps because 27 delays of 1/8 ms, halved, are 1.6875 ms: with the 0.318 ms of the accelerometer's own
500 Hz filter that is two periods of 1 ms to within 6 us, so the encoder counts of two ticks ago need no
interpolation. Equiripple: what aliases into 0..60 Hz at 1 kHz comes from 940 Hz and up.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
from scipy import signal

HEADER = Path(__file__).resolve().parent.parent / "firmware" / "core" / "impid_decimator_taps.h"
TAPS = 28
SCALE_BITS = 16
RATE_HZ = 8000
PASS_HZ, STOP_HZ = 60, 940


def design() -> np.ndarray:
    """Integer taps, symmetric, whose sum is exactly 2**SCALE_BITS. Shape (TAPS,)."""
    bands = [0, PASS_HZ, STOP_HZ, RATE_HZ / 2]
    ideal = signal.remez(TAPS, bands, [1, 0], fs=RATE_HZ)
    half = np.round(ideal[: TAPS // 2] / ideal.sum() * 2**SCALE_BITS).astype(int)
    half[-1] += 2 ** (SCALE_BITS - 1) - half.sum()  # rounding's rest goes where it is relatively smallest
    return np.concatenate([half, half[::-1]])


def header(taps: np.ndarray) -> str:
    _, response = signal.freqz(taps / 2**SCALE_BITS, worN=np.array([PASS_HZ, STOP_HZ]), fs=RATE_HZ)
    pass_db, stop_db = 20 * np.log10(np.abs(response))
    rows = [", ".join(f"{tap:5d}" for tap in row) for row in taps.reshape(-1, 7)]
    return "\n".join(
        [
            "/* Written by scripts/design_decimator.py: change the design there.",
            " *",
            f" * Equiripple low-pass, {TAPS} taps at {RATE_HZ} Hz, symmetric, gain at DC exactly 1",
            f" * (sum 2^{SCALE_BITS}); {pass_db:.3f} dB at {PASS_HZ} Hz,",
            f" * {stop_db:.1f} dB at {STOP_HZ} Hz and less above.",
            " */",
            "/* clang-format off */",
            "#ifndef IMPID_DECIMATOR_TAPS_H",
            "#define IMPID_DECIMATOR_TAPS_H",
            "",
            f"#define IMPID_DECIMATOR_TAPS {TAPS}u",
            f"#define IMPID_DECIMATOR_SCALE_BITS {SCALE_BITS}",
            "#define IMPID_DECIMATOR_TAP_VALUES \\",
            "    " + ", \\\n    ".join(rows),
            "",
            "#endif",
            "",
        ]
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="fail where the committed taps differ")
    check = parser.parse_args().check
    text = header(design())
    if not check:
        HEADER.write_text(text)
    elif not HEADER.is_file() or HEADER.read_text() != text:
        sys.exit(f"{HEADER.name} differs from its design: run {Path(__file__).name}")


if __name__ == "__main__":
    main()
