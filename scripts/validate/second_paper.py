"""The second paper's spring arrays, arm and figures on its own protocol, simulated, and what goes beyond it.

    python scripts/validate/second_paper.py [--out docs/validation] [--work build/validate] [--seed 21]

Runs the simulator (skipped where a study is there already), evaluates every trial alone and all trials of a load
together, and writes second_paper.md, second_paper.json and the figures. Each step's numbers are kept below
WORK/second_paper: an interrupted run goes on where it stopped; delete a file there to repeat its step.
"""

import argparse
import json
from functools import partial
from pathlib import Path

import numpy as np
from impid_host.impedance.spectral.agreement import Agreement
from impid_host.impedance.spectral.distortion import DistortionLevels
from impid_host.report.spectral_plots import (
    agreement_figure,
    coherence_figure,
    detection_figure,
    ellipse_figure,
    impedance_figure,
    input_coherence_figure,
)
from second_paper_page import write_page
from second_paper_runs import (
    ARRAYS,
    HIDDEN,
    SETTINGS,
    Json,
    cached,
    estimates_of,
    fitted_by_command,
    load_numbers,
    periodic_numbers,
    perturbation_numbers,
    say,
    signals_of,
    simulated,
    true_load,
    without_force,
)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=Path("docs/validation"))
    parser.add_argument("--work", type=Path, default=Path("build/validate"))
    parser.add_argument("--seed", type=int, default=21)
    options = parser.parse_args()
    work, out = options.work.resolve(), options.out
    work.mkdir(parents=True, exist_ok=True)
    springs = simulated("palazzolo-springs", work, options.seed)
    arm = simulated("palazzolo-arm", work, options.seed + 1)
    both = simulated("palazzolo-virtual", work, options.seed + 2)
    document: Json = {
        "command": "python scripts/validate/second_paper.py",
        "scenarios": ["palazzolo-springs", "palazzolo-arm", "palazzolo-virtual"],
        "seed": options.seed,
        "arrays": {
            name: cached(work, name, partial(load_numbers, springs, name, known=True)) for name in ARRAYS
        },
        "arm": cached(work, "arm", lambda: load_numbers(arm, "arm", known=False)),
        "fit": {
            study.name: cached(work, f"fit-{study.name}", partial(spectral_part, study))
            for study in (springs, arm, both)
        },
        "fit_without_force": cached(
            work, "fit-no-force", lambda: spectral_part(without_force(both, work / "palazzolo-no-force"))
        ),
        "perturbation": {
            load: cached(
                work,
                f"perturbation-{load}",
                partial(perturbation_numbers, work, load, source),
            )
            for load, source in (("arm", "palazzolo-arm"), ("sa3", "palazzolo-springs"))
        },
        "periodic": {
            hidden: cached(
                work,
                f"periodic-{hidden.split()[0].lower()}",
                partial(periodic_numbers, work, hidden),
            )
            for hidden in HIDDEN
        },
    }
    coverage = out / "spectral_coverage.json"
    document["coverage"] = json.loads(coverage.read_text(encoding="utf-8")) if coverage.exists() else None
    out.mkdir(parents=True, exist_ok=True)
    draw(document, springs, arm, out)
    (out / "second_paper.md").write_text("\n".join(write_page(document)) + "\n", encoding="utf-8")
    text = ",\n".join(f"{json.dumps(k)}: {json.dumps(v)}" for k, v in without_lines(document).items())
    (out / "second_paper.json").write_text(f"{{\n{text}\n}}\n", encoding="utf-8")
    say(f"written to {out}")


def spectral_part(study: Path) -> Json:
    """What `impid-host fit` says of each load's stochastic trials."""
    result = fitted_by_command(study)
    return {
        "robot": result["robot"]["parameters"],
        "loads": {name: load["spectral"] for name, load in result["loads"].items() if "spectral" in load},
    }


def without_lines(document: Json) -> Json:
    """The document without what only the figures need."""
    heavy = ("line", "kind", "amplitude", "line_noise", "coherence", "frequency_Hz", "compliance_m_per_N")

    def light(value: object) -> object:
        if isinstance(value, dict):
            return {key: light(one) for key, one in value.items() if key not in heavy}
        if isinstance(value, list):
            return [light(one) for one in value]
        return float(f"{value:.6g}") if isinstance(value, float) else value

    for part in [*document["arrays"].values(), document["arm"]]:
        for setting in part["alone"].values():
            for which in setting.values():
                which.pop("published", None)
                which.pop("weighted", None)
    return {key: light(value) for key, value in document.items()}


def draw(document: Json, springs: Path, arm: Path, out: Path) -> None:
    """Figs. 5 to 10, and those of what goes beyond the paper."""
    say("drawing")
    arrays = {name: true_load(springs, name) for name in ARRAYS}
    first = estimates_of(signals_of(springs, "sa1"), arrays["sa1"])
    second = estimates_of(signals_of(arm, "arm"), None)
    fit = [np.mean([getattr(e.best.fit, m) for e in second["45 segments"]], axis=0) for m in "MBK"]
    agreements = {
        label: {name: _agreements(document["arrays"][name]["alone"][label]["derived"]) for name in ARRAYS}
        for label in SETTINGS
    }
    figures = {
        "fig5": ellipse_figure({name: K for name, (_, _, K) in arrays.items()}, "Nine spring arrays (true)"),
        "fig6": impedance_figure(first, arrays["sa1"], "Spring array sa1, mean of six trials"),
        "fig7": coherence_figure(first, "Spring array sa1, mean of six trials"),
        "fig8": agreement_figure(agreements, "Nine spring arrays, six trials each, derived estimate"),
        "fig9": impedance_figure(second, (fit[0], fit[1], fit[2]), "Arm, mean of six trials; model: fitted"),
        "fig10": coherence_figure(second, "Arm, mean of six trials"),
        "perturbation": input_coherence_figure(
            {
                f"{load}, {label}": (np.array(one["frequency_Hz"]), np.array(one["coherence"]))
                for load, part in document["perturbation"].items()
                for label, one in part["found"].items()
            },
            {
                f"{load}, {label}": one["mean_force_coherence"]
                for load, part in document["perturbation"].items()
                for label, one in part["found"].items()
            },
            "Coherence between the two forces on the load, one trial",
        ),
        "detection": detection_figure(
            {
                f"{hidden}, {method}": [_levels(axis) for axis in part[method]["axes"]]
                for hidden, part in document["periodic"].items()
                for method in ("physical sensor", "virtual sensor")
            },
            10.0,
            1,
            "Odd-random multisine: displacement that the force does not explain linearly",
        ),
    }
    for name, figure in figures.items():
        figure.savefig(out / f"second_paper_{name}.png", dpi=110)


def _agreements(part: Json) -> list[list[Agreement]]:
    return [
        [Agreement(np.array(a["vaf"], dtype=np.float64), a["r_squared"], a["upper_Hz"]) for a in trial]
        for trial in part["agreement"]
    ]


def _levels(axis: Json) -> DistortionLevels:
    names = ("excited", "odd", "even", "noise", "p_odd", "p_even")
    lines = ("line", "kind", "amplitude", "line_noise")
    parts: Json = {name: float(axis[name]) for name in names}
    parts |= {name: np.array(axis[name]) for name in lines}
    return DistortionLevels(**parts)


if __name__ == "__main__":
    main()
