"""How often the spectral method's 95 % intervals hold the truth.

    python bench/spectral_coverage.py [STUDIES]

Each study is six trials of 50 s on an exact linear arm that pushes by itself (coloured noise below 3 Hz) with
sensor noise; derived estimate, trials pooled. Prints coverage per parameter for both fits and both settings.
"""

import sys

import numpy as np
from impid_host.impedance.spectral.estimate import estimate_spectral
from spectral_validation import ARM, FS, SETTINGS, TRIALS, VOLUNTARY_N, shake

NAMES = [f"{matrix}{i}{j}" for matrix in "MBK" for i in (1, 2) for j in (1, 2)]


def main() -> None:
    studies = int(sys.argv[1]) if len(sys.argv) > 1 else 500
    rng = np.random.default_rng(5)
    true = np.concatenate([m.ravel() for m in ARM])
    z: dict[tuple[str, str], list[np.ndarray]] = {}
    for study in range(studies):
        trials = [shake(rng, ARM, 100 * (TRIALS * study + k), VOLUNTARY_N) for k in range(TRIALS)]
        for label, setting in SETTINGS.items():
            best = estimate_spectral(trials, FS, setting).best
            for which in ("fit", "weighted_fit"):
                fit = getattr(best, which)
                value = np.concatenate([getattr(fit, m).ravel() for m in "MBK"])
                sd = np.concatenate([getattr(fit, f"{m}_sd").ravel() for m in "MBK"])
                z.setdefault((label, which), []).append((value - true) / sd)
    for (label, which), scores in z.items():
        inside = 100 * np.mean(np.abs(scores) < 1.96, axis=0)
        cells = "  ".join(f"{name} {value:5.1f}" for name, value in zip(NAMES, inside, strict=True))
        print(f"{label}, {which}: all {inside.mean():.1f} %;  {cells}")


if __name__ == "__main__":
    main()
