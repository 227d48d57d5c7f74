"""Delay, gain and claims of the reflex estimator on simulated ankles, with a reflex and without one.

    python bench/reflex.py [JOINTS] [--markdown FILE] [--keep FILE] [--workers N]

JOINTS with a reflex in one direction of stretch and JOINTS without. A random-step command goes through a
third-order actuator whose states are the exact angle, speed and acceleration; the reflex is delayed by whole steps
of 0.5 ms and goes through its muscle by exact discretisation: nothing of the estimator makes the data. Noise is
white beside a slow drift of the subject's will (pole at 0.1 Hz).
"""

import argparse
import json
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import impid_host.impedance
import numpy as np
from impid_host.impedance.reflex import Band, fit_reflex, followed_band
from kept import Kept
from scipy import signal

FINE_HZ, RATE_HZ, SECONDS, FIT_S = 2000.0, 500.0, 50.0, 35.0
SIDES = {1.0: 0, -1.0: 1}


def filtered(numerator: Sequence[float], poles: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Through a continuous filter, its input straight between samples (first-order hold)."""
    b, a, _ = signal.cont2discrete((np.asarray(numerator), np.poly(poles)), 1 / FINE_HZ, method="foh")
    return np.asarray(signal.lfilter(b.ravel(), a, values))


def joint(seed: int, *, reflex: bool) -> tuple[np.ndarray, np.ndarray, dict[str, float]]:
    """Angle (N,), torque (N,), and the truth."""
    rng = np.random.default_rng([seed, reflex])
    count = int(SECONDS * FINE_HZ)
    true = {
        "I": rng.uniform(0.012, 0.02),
        "B": rng.uniform(0.5, 1.5),
        "K": rng.uniform(40.0, 120.0),
        "side": float(rng.choice([-1.0, 1.0])),
        "gain": np.exp(rng.uniform(np.log(3.0), np.log(40.0))) if reflex else 0.0,
        "delay": round(rng.uniform(0.035, 0.075) * FINE_HZ) / FINE_HZ,
        "corner": rng.uniform(7.0, 25.0),
    }
    steps = rng.integers(int(0.1 * FINE_HZ), int(0.4 * FINE_HZ), 2000)
    command = np.repeat(0.03 * rng.choice([-1.0, 1.0], len(steps)), steps)[:count]
    pole = 2 * np.pi * 6.0
    poles = -np.full(3, pole)
    theta = filtered([pole**3], poles, command)
    omega = filtered([pole**3, 0.0], poles, command)
    alpha = filtered([pole**3, 0.0, 0.0], poles, command)
    late = np.concatenate([np.zeros(round(true["delay"] * FINE_HZ)), omega])[:count]
    stretch = true["side"] * np.maximum(true["side"] * late, 0.0)
    muscle = filtered([true["corner"] ** 2], -np.full(2, true["corner"]), stretch)
    torque = true["I"] * alpha + true["B"] * omega + true["K"] * theta + true["gain"] * muscle
    p = np.exp(-2 * np.pi * 0.1 / FINE_HZ)
    drift = signal.lfilter([np.sqrt(1 - p**2)], [1.0, -p], rng.normal(size=count))
    step = int(FINE_HZ / RATE_HZ)
    noise = rng.normal(0, np.exp(rng.uniform(np.log(0.02), np.log(0.2))), count // step)
    torque = (torque + rng.uniform(0.1, 0.6) * drift)[::step] + noise
    return theta[::step], torque, true


def one(seed: int, reflex: bool) -> dict[str, Any]:
    """What became of one joint."""
    theta, torque, true = joint(seed, reflex=reflex)
    early = slice(0, int(FIT_S * RATE_HZ))
    low = followed_band(theta[early], torque[early], RATE_HZ).low_Hz
    fit = fit_reflex(theta, torque, RATE_HZ, fit_s=FIT_S, band=Band(low))
    own = SIDES[true["side"]]
    numbers = {
        "I": fit.with_reflex[0], "B": fit.with_reflex[1], "K": fit.with_reflex[2],
        "gain": fit.gain[own], "gain of the other side": fit.gain[1 - own],
        "delay": fit.delay_s, "corner": fit.corner_rad_s,
    }  # fmt: skip
    truth = true | {"gain of the other side": 0.0}
    return {
        "true": true,
        "p": fit.p_value,
        "value": {name: number.value for name, number in numbers.items()},
        "inside": {name: bool(n.low <= truth[name] <= n.high) for name, n in numbers.items()},
        "delay_half_width": (fit.delay_s.high - fit.delay_s.low) / 2,
        "delay_determined": fit.delay_determined,
        "claimed": fit.claimed,
        "vaf": [fit.vaf_intrinsic, fit.vaf_reflex],
    }


def run(joints: int, path: Path, workers: int) -> dict[str, Any]:
    """Every joint, those done by this same code taken from the file."""
    folder = Path(impid_host.impedance.__path__[0])
    files = [Path(__file__), *(folder / f"{n}.py" for n in ("reflex", "reflex_path", "linear", "colour"))]
    kept = Kept(path, files)
    done = kept.answers
    todo = [(s, r) for s in range(joints) for r in (True, False) if f"{s} {r}" not in done]
    with ProcessPoolExecutor(workers) as pool:
        for (seed, reflex), found in zip(
            todo, pool.map(one, *zip(*todo, strict=True)) if todo else (), strict=True
        ):
            kept.put(f"{seed} {reflex}", found)
    return done


def counted(done: dict[str, Any], joints: int) -> dict[str, Any]:
    """Errors and coverage of those with a reflex that was claimed; claims of both."""
    with_one = [done[f"{seed} True"] for seed in range(joints)]
    without = [done[f"{seed} False"] for seed in range(joints)]
    said = [own for own in with_one if own["claimed"]]
    error = 1e3 * np.array([own["value"]["delay"] - own["true"]["delay"] for own in said])
    gain = np.array([own["value"]["gain"] / own["true"]["gain"] - 1 for own in said])
    tight = np.array([own["delay_half_width"] <= 3e-3 for own in said])
    return {
        "joints": joints,
        "claimed_with_reflex": len(said),
        "claimed_without": sum(own["claimed"] for own in without),
        "delay_rms_ms": float(np.sqrt(np.mean(error**2))),
        "delay_median_ms": float(np.median(np.abs(error))),
        "delay_bias_ms": float(np.mean(error)),
        "delay_within_3_ms": int(np.sum(np.abs(error) <= 3.0)),
        "interval_at_most_3_ms": int(np.sum(tight)),
        "within_3_ms_where_interval_is": int(np.sum(np.abs(error[tight]) <= 3.0)),
        "gain_median_error_percent": float(100 * np.median(np.abs(gain))),
        "coverage_percent": {
            name: 100 * float(np.mean([own["inside"][name] for own in said])) for name in said[0]["inside"]
        },
    }


def page(own: dict[str, Any], command: str) -> str:
    """The Markdown page."""
    n = own["joints"]
    lines = [
        "# A joint's reflex: delay, gain, and whether there is one",
        "",
        f"`{command}`: {n} simulated ankles with a reflex (gain 3 to 40 N m s/rad, delay 35 to 75 ms, muscle 7 to 25 rad/s, one "
        f"direction of stretch) and {n} without; random steps of 3.4 deg through an actuator of 6 Hz, 50 s at 500 Hz, of which 35 s are "
        "fitted; white noise of 0.02 to 0.2 N m beside a slow drift of 0.1 to 0.6 N m.",
        "",
        "| | |",
        "| --- | --- |",
        f"| a reflex is claimed where there is one (p below 0.01) | {own['claimed_with_reflex']} of {n} |",
        f"| a reflex is claimed where there is none | {own['claimed_without']} of {n} |",
        f"| error of the delay: rms, median, mean | {own['delay_rms_ms']:.2f}, {own['delay_median_ms']:.2f}, {own['delay_bias_ms']:+.2f} ms |",
        f"| delay within 3 ms | {own['delay_within_3_ms']} of {own['claimed_with_reflex']} |",
        f"| of those whose interval is ± 3 ms or less, within 3 ms | {own['within_3_ms_where_interval_is']} of {own['interval_at_most_3_ms']} |",
        f"| error of the gain, median | {own['gain_median_error_percent']:.1f} % |",
        "",
        "95 % intervals that hold the truth, of the claimed:",
        "",
        "| | % |",
        "| --- | --- |",
        *(f"| {name} | {value:.1f} |" for name, value in own["coverage_percent"].items()),
    ]
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("joints", type=int, nargs="?", default=200)
    parser.add_argument("--markdown", type=Path)
    parser.add_argument("--keep", type=Path, default=Path("build/reflex.jsonl"))
    parser.add_argument("--workers", type=int, default=1)
    options = parser.parse_args()
    own = counted(run(options.joints, options.keep, options.workers), options.joints)
    command = f"python bench/reflex.py {options.joints}"
    text = page(own, command)
    print(text)
    if options.markdown is not None:
        options.markdown.write_text(text, encoding="utf-8")
        document = {"command": command, "result": own}
        options.markdown.with_suffix(".json").write_text(
            json.dumps(document, indent=1) + "\n", encoding="utf-8"
        )


if __name__ == "__main__":
    main()
