"""Force-perturbation trials as plots: compliance with its 95 % band and the fitted model, coherences."""

from collections.abc import Iterator

import numpy as np

from impid_host.impedance.spectral.second_order import second_order_impedance
from impid_host.impedance.stochastic import SpectralFit
from impid_host.report.page.plot import Band, Line, Plot
from impid_host.signals.arrays import Floats

_AXES = "xy"
_NORMAL = 1.96
# A random error beyond this says that the estimate is a guess; its band would leave the page.
_WORST = 1.0


def bode_plots(fit: SpectralFit) -> list[Plot]:
    """Gain and phase of each element, then the coherences; within the band of the fit."""
    return [*_elements(fit), *_coherences(fit)]


def _elements(fit: SpectralFit) -> Iterator[Plot]:
    estimate, best = fit.estimate, fit.estimate.best
    band = estimate.band
    f = estimate.frequency_Hz[band]
    model = best.weighted_fit
    omega = 2 * np.pi * f[:, None, None]
    C_model = np.linalg.inv(1j * omega * second_order_impedance(f, model.M, model.B, model.K))
    for i in range(2):
        for j in range(2):
            C, error = best.C[band][:, i, j], best.random_error[band][:, i, j]
            known = error < _WORST
            off = np.where(known, _NORMAL * error, np.nan)
            gain = 20 * np.log10(np.abs(C))
            with np.errstate(invalid="ignore", divide="ignore"):
                low = gain + 20 * np.log10(np.where(off < 1, 1 - off, np.nan))
                high = gain + 20 * np.log10(1 + off)
            phase = np.rad2deg(np.angle(C))
            swing = np.rad2deg(np.arcsin(np.where(off < 1, off, np.nan)))
            what = f"{fit.load}, {fit.method}: compliance C{_AXES[i]}{_AXES[j]}"
            where = f"{fit.load}_{fit.method.split()[0]}_{_AXES[i]}{_AXES[j]}"
            yield Plot(
                key=f"bode_gain_{where}",
                title=f"{what}, gain",
                x_label="frequency (Hz)",
                y_label="gain (dB re 1 m/N)",
                lines=(
                    Line(f, gain, "estimate", "second"),
                    Line(f, 20 * np.log10(np.abs(C_model[:, i, j]) + 1e-12), "model M, B, K", "first"),
                ),
                bands=(Band(f, low, high, "second"),),
                caption="the band is 95 % of the random error; where there is none, the coherence is too low",
            )
            yield Plot(
                key=f"bode_phase_{where}",
                title=f"{what}, phase",
                x_label="frequency (Hz)",
                y_label="phase (degrees)",
                lines=(
                    Line(*_unbroken(f, phase), "estimate", "second"),
                    Line(*_unbroken(f, np.rad2deg(np.angle(C_model[:, i, j]))), "model M, B, K", "first"),
                ),
                bands=(Band(f, phase - swing, phase + swing, "second"),),
                y_range=(-190.0, 190.0),
            )


def _unbroken(f: Floats, phase: Floats) -> tuple[Floats, Floats]:
    """A phase in degrees, interrupted where it goes round the circle."""
    round_ = np.flatnonzero(np.abs(np.diff(phase)) > 180.0) + 1
    return np.insert(f, round_, np.nan), np.insert(phase, round_, np.nan)


def _coherences(fit: SpectralFit) -> Iterator[Plot]:
    estimate, best = fit.estimate, fit.estimate.best
    band = estimate.band
    f = estimate.frequency_Hz[band]
    chance = np.full_like(f, estimate.zero_coherence_level)
    for j in range(2):
        partial = best.partial_coherence[band]
        yield Plot(
            key=f"coherence_{fit.load}_{fit.method.split()[0]}_F{_AXES[j]}",
            title=f"{fit.load}, {fit.method}: partial coherence with F{_AXES[j]}",
            x_label="frequency (Hz)",
            y_label="partial coherence",
            lines=(
                Line(f, partial[:, 0, j], "motion along x", "second"),
                Line(f, partial[:, 1, j], "motion along y", "first"),
                Line(f, chance, "unrelated signals stay below in 95 % of cases", "floor"),
            ),
            y_range=(0.0, 1.02),
        )
    yield Plot(
        key=f"coherence_{fit.load}_{fit.method.split()[0]}_multiple",
        title=f"{fit.load}, {fit.method}: multiple coherence",
        x_label="frequency (Hz)",
        y_label="multiple coherence",
        lines=(
            Line(f, best.multiple_coherence[band][:, 0], "motion along x", "second"),
            Line(f, best.multiple_coherence[band][:, 1], "motion along y", "first"),
        ),
        y_range=(0.0, 1.02),
    )
