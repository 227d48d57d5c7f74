"""The spring-array campaign of [P] Sec. III-A on synthetic truth: nine arrays, six trials, both settings.

    python bench/spectral_validation.py [OUT_FOLDER]

Prints VAF, R^2 and the fitted parameters per array beside the array's own, the scatter of the fit over trials
beside the stated deviations, and writes Figs. 5 to 10 as PNG. Robot, load and arm are exact linear systems,
so what differs from the truth is the estimator's.
"""

import sys
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
from impid_host.design.perturbation import design_perturbation
from impid_host.impedance.spectral.estimate import (
    SURROGATES,
    SpectralEstimate,
    TrialSignals,
    estimate_spectral,
)
from impid_host.impedance.spectral.welch import FINE, SMOOTH, WelchSetting
from impid_host.report.spectral_plots import (
    agreement_figure,
    coherence_figure,
    ellipse_figure,
    impedance_figure,
)

FS = 500.0
TRIALS = 6
SETTINGS = {"5 segments": FINE, "45 segments": SMOOTH}
ROBOT = (np.array([[1.0, 0.15], [0.15, 1.3]]), 4.0 * np.eye(2), 60.0 * np.eye(2))
ARM = (
    np.array([[1.45, 0.66], [0.66, 1.06]]),
    np.array([[10.9, 2.9], [2.9, 6.0]]),
    np.array([[172.0, 31.0], [31.0, 112.0]]),
)
# Encoder steps of 0.01 mm, a force sensor of 0.05 N noise, and an arm that pushes by itself with 0.5 N below
# 3 Hz.
POSITION_NOISE_M, FORCE_NOISE_N, VOLUNTARY_N = 3e-6, 0.05, 0.5
Matrices = tuple[np.ndarray, np.ndarray, np.ndarray]


def dynamic_stiffness(omega: np.ndarray, M: np.ndarray, B: np.ndarray, K: np.ndarray) -> np.ndarray:
    w = omega[:, np.newaxis, np.newaxis]
    return np.asarray(K + 1j * w * B - w**2 * M)


def shake(
    rng: np.random.Generator, load: Matrices, first_seed: int, voluntary_N: float, candidates: int = 100
) -> TrialSignals:
    """One trial, solved exactly by frequency, with sensor noise."""
    perturbation = design_perturbation(4.0, first_seed=first_seed, candidates=candidates).force
    samples = len(perturbation)
    n_fft = 2**17
    omega = 2 * np.pi * np.fft.rfftfreq(n_fft, 1 / FS)
    own = np.zeros((n_fft // 2 + 1, 2), dtype=complex)
    slow = omega < 2 * np.pi * 3.0
    own[slow] = np.fft.rfft(rng.standard_normal((samples, 2)), n_fft, axis=0)[slow]
    own *= voluntary_N / np.std(np.fft.irfft(own, n_fft, axis=0)[:samples])
    stiffness = dynamic_stiffness(omega, *load)
    both = np.linalg.inv(stiffness + dynamic_stiffness(omega, *ROBOT))
    d = np.einsum("fij,fj->fi", both, np.fft.rfft(perturbation, n_fft, axis=0) + own)
    F = np.einsum("fij,fj->fi", stiffness, d) - own
    d_t, F_t = (np.fft.irfft(x, n_fft, axis=0)[:samples] for x in (d, F))
    return TrialSignals(
        F_t + FORCE_NOISE_N * rng.standard_normal(F_t.shape),
        d_t + POSITION_NOISE_M * rng.standard_normal(d_t.shape),
        perturbation,
    )


def evaluate(
    rng: np.random.Generator, load: Matrices, voluntary_N: float, *, known: bool
) -> dict[str, list[SpectralEstimate]]:
    trials = [shake(rng, load, 1000 * k, voluntary_N) for k in range(TRIALS)]
    expected = load if known else None
    return {
        label: [
            estimate_spectral([trial], FS, setting, expected=expected, surrogates=0 if known else SURROGATES)
            for trial in trials
        ]
        for label, setting in SETTINGS.items()
    }


def spread(estimates: list[SpectralEstimate], truth: Matrices, which: str) -> str:
    """Truth, mean, scatter and stated deviation of each parameter; `which` is `fit` or `weighted_fit`."""
    lines = [f"  {which}"]
    for name, true in zip("MBK", truth, strict=True):
        found = np.array([getattr(getattr(e.best, which), name) for e in estimates])
        stated = np.sqrt(
            np.mean([getattr(getattr(e.best, which), f"{name}_sd") ** 2 for e in estimates], axis=0)
        )
        cells = [
            f"{t:8.3f} {m:8.3f} {s:7.3f} {d:7.3f}"
            for t, m, s, d in zip(
                true.ravel(),
                found.mean(axis=0).ravel(),
                found.std(axis=0, ddof=1).ravel(),
                stated.ravel(),
                strict=True,
            )
        ]
        lines += [
            f"    {name}{k // 2 + 1}{k % 2 + 1}  true, mean, scatter, stated: {cell}"
            for k, cell in enumerate(cells)
        ]
    return "\n".join(lines)


def spring_matrices(data: dict[str, Any], array: dict[str, Any]) -> Matrices:
    a = np.deg2rad(array["major_axis_deg"])
    R = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
    K = R @ np.diag([array["k_major_N_m"], array["k_minor_N_m"]]) @ R.T
    return data["mass_kg"] * np.eye(2), np.diag(2 * data["zeta"] * np.sqrt(data["mass_kg"] * np.diag(K))), K


def settings_line(setting: WelchSetting) -> str:
    return f"{setting.n_fft}/{setting.n_window}/{setting.n_overlap}"


def main() -> None:
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else None
    rng = np.random.default_rng(1)
    data = tomllib.loads(
        (Path(__file__).parents[1] / "hil_sim" / "scenarios" / "spring_arrays.toml").read_text()
    )
    arrays = {a["name"]: spring_matrices(data, a) for a in data["array"]}
    agreements: dict[str, dict[str, Any]] = {label: {} for label in SETTINGS}
    first: dict[str, list[SpectralEstimate]] = {}
    for name, load in arrays.items():
        result = evaluate(rng, load, 0.0, known=True)
        first = first or result
        for label, estimates in result.items():
            agreements[label][name] = [e.best.agreement for e in estimates]
            for band in range(2):
                r2 = np.array([e.best.agreement[band].r_squared for e in estimates])
                vaf = np.array([e.best.agreement[band].vaf_percent for e in estimates])
                cells = " ".join(f"{v:6.1f}" for v in vaf.mean(axis=0).ravel())
                upper = estimates[0].best.agreement[band].upper_Hz
                setting = settings_line(SETTINGS[label])
                print(f"{name} {setting} 0-{upper:g} Hz VAF {cells}  R2 {r2.mean():.4f} min {r2.min():.4f}")
        print(spread(result["5 segments"], load, "weighted_fit"))
    arm = evaluate(rng, ARM, VOLUNTARY_N, known=False)
    for label, estimates in arm.items():
        print(f"arm, {label}")
        print(spread(estimates, ARM, "fit"))
        print(spread(estimates, ARM, "weighted_fit"))
    print(arm["45 segments"][0])
    if out is None:
        return
    out.mkdir(parents=True, exist_ok=True)
    fit = arm["45 segments"][0].best.fit
    figures = {
        "fig5": ellipse_figure({name: K for name, (_, _, K) in arrays.items()}, "Nine spring arrays"),
        "fig6": impedance_figure(first, arrays["sa1"], "Spring array sa1"),
        "fig7": coherence_figure(first, "Spring array sa1"),
        "fig8": agreement_figure(agreements, "Nine spring arrays, six trials each"),
        "fig9": impedance_figure(arm, (fit.M, fit.B, fit.K), "Arm"),
        "fig10": coherence_figure(arm, "Arm"),
    }
    for name, figure in figures.items():
        figure.savefig(out / f"spectral_{name}.png", dpi=120)


if __name__ == "__main__":
    main()
