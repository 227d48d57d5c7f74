"""What second_paper.py measures: arrays, arm, perturbations, sensor-less robot, periodic perturbations."""

import json
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from impid_host.design.force_multisine import design_force_multisines
from impid_host.design.interaction import Contact, modified_perturbation
from impid_host.design.perturbation import design_perturbation
from impid_host.impedance.campaign import Options, fit_study
from impid_host.impedance.spectral.estimate import SpectralEstimate, TrialSignals, estimate_spectral
from impid_host.impedance.spectral.second_order import SecondOrderFit
from impid_host.impedance.spectral.welch import FINE, SMOOTH
from impid_host.impedance.stochastic import load_signals, longest_stretch, shaken
from impid_host.robot.model import robot_model
from impid_host.study.folder import read_study, read_trial
from impid_host.study.setup_file import read_setup

RATE = 1000.0
TRIALS = 6
SETTINGS = {"5 segments": FINE.scaled(RATE), "45 segments": SMOOTH.scaled(RATE)}
AT_HZ = (0.25, 0.5, 1.0, 2.0, 4.0, 6.0, 8.0, 10.0)
ARRAYS = tuple(f"sa{k}" for k in range(1, 10))
ALPHA = (0.06929, 0.04217, 0.04416, 0.06510, 0.07389)  # [D] Table VI, the simulated robot
LINKS = (0.254, 0.2667)
Json = dict[str, Any]
Matrices = tuple[np.ndarray, np.ndarray, np.ndarray]


def say(words: str) -> None:
    sys.stderr.write(words + "\n")


def tool(name: str, *arguments: str) -> str:
    """Run one of the two command line tools and return what it printed."""
    found = Path(sys.executable).with_name(name)
    done = subprocess.run([str(found), *arguments], check=False, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{name} {' '.join(arguments)}: {done.stderr.strip()}")
    return done.stdout


def cached(work: Path, name: str, compute: Callable[[], Json]) -> Json:
    """The result of a step, from `work` where it is there already."""
    place = work / "second_paper" / f"{name}.json"
    if not place.exists():
        say(name)
        result = compute()
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(json.dumps(result), encoding="utf-8")
    return dict(json.loads(place.read_text(encoding="utf-8")))


def simulated(scenario: str | Path, work: Path, seed: int) -> Path:
    """The study of a scenario, made unless it is there."""
    study = work / Path(scenario).stem
    if not (study / "setup.toml").exists():
        say(f"simulating {Path(scenario).stem}")
        truth = work / f"{study.name}.truth.json"
        tool(
            "impid-sim",
            "study",
            str(scenario),
            "--out",
            str(study),
            "--seed",
            str(seed),
            "--truth",
            str(truth),
        )
    return study


def true_load(study: Path, load: str) -> Matrices:
    """M, B, K of a load, as the simulator has it."""
    truth = json.loads((study.parent / f"{study.name}.truth.json").read_text(encoding="utf-8"))
    own = next(t["load"] for name, t in truth["trials"].items() if name.startswith(load))
    return np.array(own["M"]), np.array(own["B"]), np.array(own["K"])


def signals_of(study: Path, load: str) -> list[TrialSignals]:
    """Force by the physical sensor, motion and perturbation of every trial of a load."""
    setup = read_setup(study / "setup.toml")
    model = robot_model(setup.robot)
    trials = [shaken(read_trial(place, setup), setup, model) for place in sorted(study.glob(f"{load}_*"))]
    return [longest_stretch(s, one) for s, one in zip(load_signals(trials, None), trials, strict=True)]


def estimates_of(
    trials: Sequence[TrialSignals], expected: Matrices | None
) -> dict[str, list[SpectralEstimate]]:
    """Every trial alone by both settings, as [P] evaluates them."""
    return {
        label: [estimate_spectral([t], RATE, setting, expected=expected, surrogates=0) for t in trials]
        for label, setting in SETTINGS.items()
    }


def load_numbers(study: Path, load: str, *, known: bool) -> Json:
    """One load: agreement per trial, coherences and random errors at some frequencies, fits of all trials."""
    truth = true_load(study, load)
    trials = signals_of(study, load)
    out: Json = {"truth": [m.tolist() for m in truth], "alone": {}, "pooled": {}}
    for label, estimates in estimates_of(trials, truth if known else None).items():
        out["alone"][label] = {
            which: _alone([getattr(e, which) for e in estimates], estimates[0])
            for which in ("direct", "derived")
        }
    for label, setting in SETTINGS.items():
        whole = estimate_spectral(trials, RATE, setting, expected=truth if known else None)
        out["pooled"][label] = {
            "averages": whole.averages,
            "published": fit_numbers(whole.best.fit),
            "weighted": fit_numbers(whole.best.weighted_fit),
            "agreement": [_agreement(a) for a in whole.best.agreement],
        }
        out["checks"] = [str(check) for check in whole.checks]
    return out


def _alone(responses: list[Any], estimate: SpectralEstimate) -> Json:
    at = [int(np.argmin(np.abs(estimate.frequency_Hz - f))) for f in AT_HZ]
    mean = {
        name: np.mean([getattr(r, name)[at] for r in responses], axis=0).tolist()
        for name in ("partial_coherence", "multiple_coherence")
    }
    error = np.median([r.random_error[at] for r in responses], axis=0)
    return mean | {
        "random_error": error.tolist(),
        "agreement": [[_agreement(a) for a in r.agreement] for r in responses],
        "weighted": [fit_numbers(r.weighted_fit) for r in responses],
        "published": [fit_numbers(r.fit) for r in responses],
    }


def _agreement(a: Any) -> Json:
    vaf = [[float(v) if np.isfinite(v) else None for v in row] for row in a.vaf_percent]
    return {"upper_Hz": a.upper_Hz, "vaf": vaf, "r_squared": a.r_squared}


def fit_numbers(fit: SecondOrderFit) -> Json:
    """Values and, where they are numbers, 95 % intervals."""
    known = bool(np.all(np.isfinite(fit.K_sd)))
    return {
        name: {"value": getattr(fit, name).tolist()} | ({"ci95": fit.ci95(name).tolist()} if known else {})
        for name in "MBK"
    }


def fitted_by_command(study: Path) -> Json:
    """`impid-host fit STUDY --json -`."""
    return dict(json.loads(tool("impid-host", "fit", str(study), "--json", "-")))


def without_force(study: Path, out: Path) -> Path:
    """The same study as a robot without a force sensor would have recorded it."""
    for source in sorted(study.rglob("*.*")):
        target = out / source.relative_to(study)
        target.parent.mkdir(parents=True, exist_ok=True)
        text = source.read_text(encoding="utf-8")
        if source.name == "robot.csv":
            lines = [line.split(",") for line in text.splitlines()]
            kept = [k for k, name in enumerate(lines[0]) if name not in ("fx", "fy")]
            text = "\n".join(",".join(line[k] for k in kept) for line in lines) + "\n"
        target.write_text(text, encoding="utf-8")
    return out


def perturbation_numbers(work: Path, load: str, source: str) -> Json:
    """Coherence of the two forces on a load: unsearched seeds, searched ones, and T_model^-1 before them."""
    searched = design_perturbation(4.0)
    plain = design_perturbation(4.0, candidates=2, first_seed=1000)
    truth = true_load(work / source, load)
    assumed = (1.2 * np.eye(2), 8.0 * np.eye(2), 140.0 * np.eye(2))
    forces = {
        "unsearched": plain.force,
        "searched": searched.force,
        "T_model^-1, load guessed": modified_perturbation(searched.force, 500.0, contact(assumed)),
        "T_model^-1, load known": modified_perturbation(searched.force, 500.0, contact(truth)),
    }
    forces = {label: 4.0 * force / np.sqrt(np.mean(force**2)) for label, force in forces.items()}
    folder = work / f"perturbed-{load}"
    folder.mkdir(parents=True, exist_ok=True)
    names = dict(zip(forces, "abcd", strict=True))
    for label, force in forces.items():
        write_command(folder / f"{names[label]}.csv", force)
    scenario = folder / f"perturbed-{load}-study.toml"
    trials = [(f"{load}_{letter}", load, f"{letter}.csv", 50.0) for letter in names.values()]
    scenario.write_text(scenario_text(source, trials), encoding="utf-8")
    study = simulated(scenario, work, 24)
    found: Json = {}
    for (label, force), trial in zip(forces.items(), signals_of(study, load), strict=True):
        e = estimate_spectral([trial], RATE, SETTINGS["5 segments"], surrogates=0)
        assert e.derived is not None
        delivered = np.linalg.svd(contact(truth).response(e.frequency_Hz[e.band]), compute_uv=False)
        found[label] = {
            "frequency_Hz": e.frequency_Hz[e.band].tolist(),
            "coherence": e.input_coherence[e.band].tolist(),
            "mean_force_coherence": float(e.input_coherence[e.band].mean()),
            "worst_force_coherence": float(e.input_coherence[e.band].max()),
            "command_rms_N": float(np.sqrt(np.mean(force**2))),
            "command_peak_N": float(np.abs(force).max()),
            "force_rms_N": float(np.sqrt(np.mean(trial.force**2))),
            "model_condition": float(np.max(delivered[:, 0] / delivered[:, 1])),
            "median_random_error": {
                "direct": float(np.median(e.direct.random_error[e.band])),
                "derived": float(np.median(e.derived.random_error[e.band])),
            },
        }
    return {
        "command_coherence": {"unsearched": plain.chance_coherence, "searched": searched.mean_coherence}
    } | {
        "found": found,
        "chance": searched.chance_coherence,
    }


def contact(load: Matrices) -> Contact:
    """The simulated robot at (0.36, 0) m in contact with a load, held by 100 N/m and 5 N s/m."""
    bend = np.arccos((0.36**2 - LINKS[0] ** 2 - LINKS[1] ** 2) / (2 * LINKS[0] * LINKS[1]))
    first = np.arctan2(LINKS[1] * np.sin(bend), LINKS[0] + LINKS[1] * np.cos(bend))
    second = first - bend + np.pi / 2
    s, c = np.sin([first, second]), np.cos([first, second])
    h = -0.5 * ALPHA[1] * np.sin(first - second)
    return Contact(
        inertia=np.array([[ALPHA[0], h], [h, ALPHA[2]]]),
        friction=np.diag(ALPHA[3:]),
        jacobian=np.array([[-LINKS[0] * s[0], LINKS[1] * c[1]], [LINKS[0] * c[0], LINKS[1] * s[1]]]),
        kp=100.0,
        kd=5.0,
        M=load[0],
        B=load[1],
        K=load[2],
    )


def write_command(place: Path, force: np.ndarray) -> None:
    """A CSV that a stochastic trial can play."""
    t = np.arange(len(force)) / 500.0
    table = np.column_stack([t, force])
    np.savetxt(place, table, delimiter=",", header="t,fdx,fdy", comments="", fmt=["%.3f", "%.6f", "%.6f"])


def scenario_text(base: str, trials: Sequence[tuple[str, str, str, float]], hidden: str = "") -> str:
    """A shipped scenario's laboratory with other trials: (name, load, CSV, seconds), and what is hidden.

    Free trials of the base stay.
    """
    import hil_sim.scenarios.load as shipped  # noqa: PLC0415  (a script may name the simulator, the host may not)

    text = (shipped.SHIPPED / f"{base}.toml").read_text(encoding="utf-8")
    head, *rest = text.split("[[trials]]")
    kept = [part for part in rest if 'kind = "free"' in part]
    own = [
        f'name = "{name}"\nkind = "stochastic"\non = "{"arm" if load == "arm" else "mass-spring"}"\n'
        f'load = "{load}"\nduration_s = {seconds}\ncommand_csv = "{csv}"\nrobot_zero_s = {3.25 * k + 1}\n'
        for k, (name, load, csv, seconds) in enumerate(trials)
    ]
    return head + hidden + "\n" + "\n".join(f"[[trials]]\n{part.strip()}\n" for part in kept + own)


HIDDEN = {
    "nothing": "",
    "cubic spring in the load": '[[effects]]\neffect = "load.stiffness_cubic"\ncubic = 30000.0\n',
    "Coulomb friction in the robot": (
        '[[effects]]\neffect = "friction.coulomb"\nwhere = ["joint1", "joint2"]\ntorque = 0.1\n'
    ),
}


def periodic_numbers(work: Path, hidden: str) -> Json:
    """Odd-random multisines on the arm, by physical and by virtual sensor, with something hidden."""
    slug = hidden.split(maxsplit=1)[0].lower()
    folder = work / f"multisine-{slug}"
    if not (folder / "study.toml").exists():
        folder.mkdir(parents=True, exist_ok=True)
        tool("impid-host", "design", "multisine", "--rms", "4", "--out", str(folder))
        trials = [
            (f"arm_r{r}_e{e}", "arm", f"force_r{r}_e{e}.csv", 50.0) for r in range(1, 5) for e in (1, 2)
        ]
        text = scenario_text("palazzolo-virtual", trials, HIDDEN[hidden])
        (folder / f"multisine-{slug}-study.toml").write_text(text, encoding="utf-8")
    study = simulated(folder / f"multisine-{slug}-study.toml", work, 25)
    result = fit_study(read_study(study), Options())
    out: Json = {"period_s": 10.0, "lines": len(design_force_multisines(4.0).harmonics)}
    for fit in result.spectral:
        part = fit.periodic
        if part is None:
            raise RuntimeError(f"{study.name}: the periodic perturbation was not recognised")
        bla = part.compliance
        size = float(np.sqrt(np.mean(np.abs(bla.G) ** 2)))
        out[fit.method] = {
            "verdict": bla.verdict,
            "noise_percent": 100 * float(np.sqrt(np.mean(bla.noise_sd**2))) / size,
            "distortion_percent": 100 * float(np.sqrt(np.mean(bla.distortion_sd**2))) / size,
            "p_value": bla.p_value,
            "axes": [
                {
                    "verdict": level.verdict,
                    "odd_percent": 100 * level.odd / level.excited,
                    "even_percent": 100 * level.even / level.excited,
                    "noise_percent": 100 * level.noise / level.excited,
                    "p_odd": level.p_odd,
                    "p_even": level.p_even,
                    "excited": level.excited,
                    "odd": level.odd,
                    "even": level.even,
                    "noise": level.noise,
                    "line": level.line.tolist(),
                    "kind": level.kind.tolist(),
                    "amplitude": level.amplitude.tolist(),
                    "line_noise": level.line_noise.tolist(),
                }
                for level in part.distortion
            ],
            "K": fit.K.value.tolist(),
        }
    return out
