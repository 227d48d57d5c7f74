"""Which cut-off: error of robot and load against the narrow filter's cut-off, with noise of three sizes.

    python bench/cutoff.py [STUDIES] [--markdown FILE]

Studies as in bench/coverage.py (white noise), times 1, 5 and 25 in the accelerometer; prints bias and rms
error in % of the true value, worst of alpha1 to alpha3 and of m, kxx, kyy, by Method 1.
"""

import sys
from pathlib import Path

import coverage
import numpy as np
from coverage import ALPHA, STRUCTURE, trial, truth
from impid_host.impedance.identify import identify_load, identify_robot
from impid_host.impedance.rows import Split
from impid_host.signals.chain import DEFAULT

CUTOFFS_HZ = (2.0, 3.0, 4.5, 7.0, 12.0, 25.0)
NOISE = (1.0, 5.0, 25.0)


def errors(cutoff_hz: float, factor: float, studies: int) -> dict[str, np.ndarray]:
    """Relative errors, (studies, k): alpha1 to alpha3, and m, kxx, kyy."""
    chain, load = DEFAULT.with_cutoff(cutoff_hz), truth("mass-spring")
    coverage.ACCELERATION_M_S2 = 0.015 * factor
    robot_errors, load_errors = [], []
    for seed in range(studies):
        rng = np.random.default_rng([seed, 3])
        free = [trial(rng, k, None, None)[0] for k in range(2)]
        loaded = [trial(rng, 2 + k, load, None)[0] for k in range(2)]
        robot = identify_robot(free, STRUCTURE, chain, Split())
        fit = identify_load(loaded, load[0], chain, Split(), robot=robot.parameters, handle_mass_kg=0.0)
        robot_errors.append((robot.estimate.value / ALPHA - 1)[:3])
        load_errors.append((fit.estimate.value / load[1] - 1)[:3])
    return {"alpha": np.array(robot_errors), "load": np.array(load_errors)}


def main() -> None:
    words = sys.argv[1:]
    to = Path(words.pop(words.index("--markdown") + 1)) if "--markdown" in words else None
    words = [word for word in words if word != "--markdown"]
    studies = int(words[0]) if words else 30
    lines = [
        "# The cut-off by evidence",
        "",
        f"`python bench/cutoff.py {studies}`: {studies} studies each; accelerometer noise of 1, 5 and 25 times 15 mm/s² rms "
        "per sample at 250 Hz. Bias / rms error in %, the worst of α1 to α3, and of m, kxx, kyy by Method 1.",
        "",
        "| cut-off (Hz) | " + " | ".join(f"α, noise × {f:g} | load, noise × {f:g}" for f in NOISE) + " |",
        "| --- | " + " | ".join("---" for _ in range(2 * len(NOISE))) + " |",
    ]
    for cutoff in CUTOFFS_HZ:
        cells = []
        for factor in NOISE:
            for error in errors(cutoff, factor, studies).values():
                worst = int(np.argmax(np.sqrt(np.mean(error**2, axis=0))))
                bias, rms = error[:, worst].mean(), np.sqrt(np.mean(error[:, worst] ** 2))
                cells.append(f"{100 * bias:+.2f} / {100 * rms:.2f}")
        lines.append(f"| {cutoff:g} | " + " | ".join(cells) + " |")
        print(lines[-1], flush=True)
    if to is not None:
        to.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
