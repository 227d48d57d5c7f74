"""How often the spectral method's 95 % intervals hold the truth.

    python bench/spectral_coverage.py [STUDIES] [--out FILE.json] [--summary docs/validation/spectral_coverage.json]

Each study is six trials of 50 s on an exact linear arm that pushes by itself (coloured noise below 3 Hz) with
sensor noise; derived estimate, trials pooled, both fits and both settings. The virtual sensor's rows have the
error of a robot identified with the standard deviations of Dyck and Tavakoli's Table VI, drawn anew for each
study. Studies already in FILE are not repeated.
"""

import argparse
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from impid_host.impedance.spectral.estimate import TrialSignals, estimate_spectral
from impid_host.impedance.spectral.second_order import NORMAL_95, SecondOrderFit
from impid_host.impedance.spectral.welch import FINE, SMOOTH
from spectral_validation import ARM, FS, TRIALS, VOLUNTARY_N, shake

NAMES = [f"{matrix}{i}{j}" for matrix in "MBK" for i in "xy" for j in "xy"]
TRUE = np.concatenate([m.ravel() for m in ARM])
SETTINGS = {"5 segments": FINE, "45 segments": SMOOTH}
FITS = {"published": "fit", "weighted": "weighted_fit"}
# [D] Table VI; links of 0.254 and 0.2667 m at 45 degrees each.
ALPHA_SD = np.array([3e-5, 7e-5, 4e-5, 1.76e-3, 7.2e-4])
L1, L2, POSE = 0.254, 0.2667, np.deg2rad([45.0, 45.0])
CANDIDATES = 8


def virtual(trial: TrialSignals, error: np.ndarray) -> TrialSignals:
    """The trial with a force from the robot's motion, whose parameters are off by `error`, (5,)."""
    s, c = np.sin(POSE), np.cos(POSE)
    J = np.array([[-L1 * s[0], L2 * c[1]], [L1 * c[0], L2 * s[1]]])
    theta = np.linalg.solve(J, trial.displacement.T).T
    omega = np.gradient(theta, 1 / FS, axis=0)
    alpha = np.gradient(omega, 1 / FS, axis=0)
    zero = np.zeros(len(theta))
    h = -0.5 * np.sin(POSE[0] - POSE[1])
    Y = np.array(
        [
            [alpha[:, 0], h * alpha[:, 1], zero, omega[:, 0], zero],
            [zero, h * alpha[:, 0], alpha[:, 1], zero, omega[:, 1]],
        ]
    )
    # Force of the robot on the load: what the joints give less what the links take, hence the sign.
    slope = -np.einsum("ij,jkt->tik", np.linalg.inv(J.T), Y)
    return replace(trial, force=trial.force + slope @ error, force_slope=slope)


def one_study(study: int) -> dict[str, list[list[float]]]:
    """Estimate less its bias, and standard deviation, of the twelve parameters by case."""
    rng = np.random.default_rng([5, study])
    first = 1000 * (TRIALS * study)
    trials = [shake(rng, ARM, first + 100 * k, VOLUNTARY_N, CANDIDATES) for k in range(TRIALS)]
    error = ALPHA_SD * rng.standard_normal(5)
    found: dict[str, list[list[float]]] = {}
    for label, setting in SETTINGS.items():
        best = estimate_spectral(trials, FS, setting, surrogates=25).best
        found |= {f"{label}, {name} fit": row(getattr(best, fit)) for name, fit in FITS.items()}
    own = [virtual(trial, error) for trial in trials]
    covariance = np.diag(ALPHA_SD**2)
    best = estimate_spectral(own, FS, FINE, slope_covariance=covariance, surrogates=0).best
    return found | {"5 segments, virtual sensor, weighted fit": row(best.weighted_fit)}


def row(fit: SecondOrderFit) -> list[list[float]]:
    value, sd = ([getattr(fit, f"{m}{end}").ravel() for m in "MBK"] for end in ("", "_sd"))
    return [(np.concatenate(value) - fit.bias.ravel()).tolist(), np.concatenate(sd).tolist()]


def summary(studies: list[dict[str, list[list[float]]]]) -> dict[str, dict[str, Any]]:
    """Coverage in percent by case: of all parameters, and of each."""
    out: dict[str, dict[str, Any]] = {}
    for case in studies[0]:
        value, sd = np.moveaxis(np.array([study[case] for study in studies]), 1, 0)
        inside = 100 * np.mean(np.abs(value - TRUE) < NORMAL_95 * sd, axis=0)
        out[case] = {
            "all": float(inside.mean()),
            "each": inside.tolist(),
            "stated_over_scatter": (np.sqrt(np.mean(sd**2, axis=0)) / value.std(axis=0, ddof=1)).tolist(),
            "bias_over_sd": (np.mean(value - TRUE, axis=0) / value.std(axis=0, ddof=1)).tolist(),
        }
    return out


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("studies", nargs="?", type=int, default=500)
    parser.add_argument("--out", type=Path, help="every study's numbers; go on from there")
    parser.add_argument("--summary", type=Path, help="coverage alone, for scripts/validate/second_paper.py")
    options = parser.parse_args()
    done = json.loads(options.out.read_text())["studies"] if options.out and options.out.exists() else []
    while len(done) < options.studies:
        done.append(one_study(len(done)))
        if options.out and (len(done) % 10 == 0 or len(done) == options.studies):
            options.out.write_text(json.dumps({"summary": summary(done), "studies": done}))
    if options.summary:
        rounded = json.loads(json.dumps(summary(done)), parse_float=lambda text: float(f"{float(text):.4g}"))
        content = json.dumps({"count": len(done), "summary": rounded}, indent=1)
        options.summary.write_text(content + "\n", encoding="utf-8")
    print(f"{len(done)} studies; 95 % intervals that hold the truth, %")
    for case, numbers in summary(done).items():
        cells = "  ".join(f"{name} {value:5.1f}" for name, value in zip(NAMES, numbers["each"], strict=True))
        print(f"{case}: all {numbers['all']:.1f};  {cells}")


if __name__ == "__main__":
    main()
