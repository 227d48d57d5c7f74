"""Draw each effect's signature: the residual that it leaves, against its cause.

    python scripts/effect_pictures.py [NAME ...]

A random laboratory hides one effect at twelve times the noise floor. Drawn is what the papers' model leaves
with its true parameters: grey without the effect, blue with it. Pictures go to docs/img/effects/.
"""

import sys
from collections.abc import Callable
from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from numpy.typing import NDArray
from PIL import Image

from hil_sim.effects import catalogue
from hil_sim.effects.residuals import EVERY, causes, residuals
from hil_sim.scenarios.random import SMALL, random_scenario
from hil_sim.scenarios.schema import Trial
from hil_sim.trials import effects_in, without_effects
from hil_sim.world import TrialTruth

OUT = Path(__file__).resolve().parents[1] / "docs" / "img" / "effects"
SEED, STRENGTH = 21, 12.0
Array = NDArray[np.float64]
Evidence = dict[str, Array]
RATE_HZ = 1000.0 / EVERY
Cause = tuple[str, Callable[[Evidence], Array]]

W1: Cause = ("speed of joint 1 (rad/s)", lambda e: e["w"][:, 0])
Q1: Cause = ("angle of joint 1 (rad)", lambda e: e["q"][:, 0])
TIME: Cause = ("time (s)", lambda e: np.arange(e["q"].shape[0]) / RATE_HZ)
X: Cause = ("x (m)", lambda e: e["x"][:, 0])
Y: Cause = ("y (m)", lambda e: e["x"][:, 1])
VX: Cause = ("speed along x (m/s)", lambda e: e["v"][:, 0])
AX: Cause = ("acceleration along x (m/s^2)", lambda e: e["acc"][:, 0])
TAU1: Cause = ("torque of the model on joint 1 (N m)", lambda e: e["tau"][:, 0])
TAU1_RATE: Cause = (
    "rate of the torque on joint 1 (N m/s)",
    lambda e: np.gradient(e["tau"][:, 0], 1.0 / RATE_HZ),
)
TAU1_BEND: Cause = (
    "second derivative of the torque on joint 1 (N m/s^2)",
    lambda e: np.gradient(np.gradient(e["tau"][:, 0])) * RATE_HZ**2,
)
FX: Cause = ("force of the load along x (N)", lambda e: e["force"][:, 0])
FY: Cause = ("force of the load along y (N)", lambda e: e["force"][:, 1])
FX_RATE: Cause = ("rate of the load's force (N/s)", lambda e: np.gradient(e["force"][:, 0], 1.0 / RATE_HZ))
S1: Cause = ("specific force along axis 1 (m/s^2)", lambda e: e["specific"][:, 0])
S2: Cause = ("specific force along axis 2 (m/s^2)", lambda e: e["specific"][:, 1])
S1_RATE: Cause = (
    "rate of specific force along axis 1 (m/s^3)",
    lambda e: np.gradient(e["specific"][:, 0], 1.0 / RATE_HZ),
)
SWING1: Cause = (
    "turning acceleration of link 1 (rad/s^2)",
    lambda e: np.gradient(e["w"][:, 0], 1.0 / RATE_HZ),
)
SWING2: Cause = (
    "turning acceleration of link 2 (rad/s^2)",
    lambda e: np.gradient(e["w"][:, 1], 1.0 / RATE_HZ),
)


# effect: the channel in which it is drawn, and the cause.
SIGNATURES: dict[str, tuple[str, Cause]] = {
    "friction.coulomb": ("tau1", W1),
    "friction.stribeck": ("tau1", W1),
    "friction.asymmetric": ("tau1", W1),
    "friction.quadratic": ("tau1", W1),
    "friction.position": ("tau1", Q1),
    "friction.load": ("tau1", TAU1),
    "friction.presliding": ("tau1", Q1),
    "elastic.cartesian": ("fsx", X),
    "elastic.joint": ("tau1", Q1),
    "elastic.transmission": ("tau1", TAU1_BEND),
    "damping.cartesian": ("fsx", VX),
    "gravity.tilt": ("a1", TIME),
    "inertia.extra": ("fsx", AX),
    "gravity.link": ("tau1", Q1),
    "geometry.link_length": ("a2", SWING1),
    "actuator.gain": ("tau1", TAU1),
    "actuator.offset": ("tau1", Q1),
    "actuator.cogging": ("tau1", Q1),
    "actuator.delay": ("tau1", TAU1_RATE),
    "actuator.lag": ("tau1", TAU1_RATE),
    "accel.misalignment": ("a1", S2),
    "accel.scale": ("a1", S1),
    "accel.bias": ("a1", S1),
    "accel.cross_axis": ("a1", S2),
    "accel.delay": ("a1", S1_RATE),
    "accel.lever_arm": ("a1", SWING2),
    "force.scale": ("fsx", FX),
    "force.misalignment": ("fsx", FY),
    "force.cross_axis": ("fsx", FY),
    "force.bias": ("fsx", TIME),
    "force.delay": ("fsx", FX_RATE),
    "encoder.eccentricity": ("a1", S2),
    "encoder.zero": ("a1", S2),
    "encoder.scale": ("a2", SWING1),
    "clock.drift": ("tau1", TIME),
    "load.damping": ("fx", VX),
    "load.stiffness_cubic": ("fx", X),
    "load.hysteresis": ("fx", VX),
    "load.deadzone": ("fx", X),
    "load.delay": ("fx", X),
    "load.drift": ("fx", TIME),
    "load.coupling": ("fx", Y),
    "load.time_varying": ("fx", TIME),
    "outside.torque_bump": ("tau1", Q1),
    "outside.resonance": ("tau1", TIME),
    "outside.periodic": ("tau1", TIME),
    "outside.random_walk": ("tau1", TIME),
    "outside.warm_up": ("tau1", TIME),
    "outside.load_friction": ("fx", TIME),
    "outside.torque_clipped": ("tau1", TAU1),
    "outside.torque_quantised": ("tau1", TAU1),
    "outside.torque_stuck": ("tau1", TIME),
    "outside.push": ("fx", TIME),
    "outside.one_trial": ("tau1", W1),
    "outside.torque_constant": ("fsx", FX),
    "outside.capstan_creep": ("a1", TIME),
    "outside.cable_hysteresis": ("fsx", X),
    "outside.bracket": ("a1", TIME),
}
UNITS = {"tau1": "N m", "fx": "N", "fsx": "N", "a1": "m/s^2", "a2": "m/s^2"}
WORDS = {
    "tau1": "torque on joint 1\nbeyond the model",
    "fx": "virtual force less\nthe load's, x",
    "fsx": "virtual less\nmeasured force, x",
    "a1": "accelerometer less\nencoders, axis 1",
    "a2": "accelerometer less\nencoders, axis 2",
}
PLACE = {
    "accel.scale": "@x",
    "accel.bias": "@x",
    "accel.cross_axis": "@x",
    "force.scale": "@x",
    "force.cross_axis": "@x",
    "force.bias": "@x",
}


def draw(name: str) -> None:
    """One picture."""
    channel, (label, cause) = SIGNATURES[name]
    scenario, reached = random_scenario(SEED, SMALL, (name + PLACE.get(name, ""),), STRENGTH)
    wanted = [trial for trial in scenario.trials if (trial.load is None) == (channel in ("tau1", "a1", "a2"))]

    def pair(trial: Trial) -> tuple[TrialTruth, TrialTruth]:
        clean = without_effects(scenario, trial, SEED)
        return catalogue.apply(clean, effects_in(scenario, trial)), clean

    def shown(hidden: TrialTruth, clean: TrialTruth) -> float:
        change = residuals(hidden, clean).channel[channel] - residuals(clean, clean).channel[channel]
        return float(np.mean(change**2))

    # What differs from trial to trial is drawn where it shows.
    hidden, clean = max(
        (pair(one) for one in wanted if effects_in(scenario, one)), key=lambda two: shown(*two)
    )
    figure, axes = plt.subplots(figsize=(3.4, 2.2), dpi=80, layout="constrained")
    for truth, colour, size in ((hidden, "C0", 1.6), (clean, "0.6", 1.0)):
        left = residuals(truth, clean).channel[channel]
        axes.plot(cause(causes(truth, clean)), left, ".", color=colour, markersize=size)
    axes.set_title(name, fontsize=9)
    axes.set_xlabel(label, fontsize=7)
    axes.set_ylabel(f"{WORDS[channel]} ({UNITS[channel]})", fontsize=7)
    axes.tick_params(labelsize=7)
    path = OUT / f"{name}.png"
    figure.savefig(path)
    plt.close(figure)
    # Two colours and their shades: a palette makes the file a third as large.
    Image.open(path).convert("P", palette=Image.Palette.ADAPTIVE, colors=16).save(path, optimize=True)
    print(f"{path.name}: {path.stat().st_size} bytes, strength {max(reached.values()):.1f}")


def main() -> None:
    """Every effect, or those named."""
    missing = set(catalogue.ROWS) - set(SIGNATURES)
    if missing:
        sys.exit(f"no signature for {', '.join(sorted(missing))}; add it to SIGNATURES")
    OUT.mkdir(parents=True, exist_ok=True)
    for name in sys.argv[1:] or SIGNATURES:
        draw(name)


if __name__ == "__main__":
    main()
