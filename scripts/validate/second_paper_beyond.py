"""Sections of second_paper.md that go beyond the paper: both domains, virtual sensor, distortion, coverage."""

from typing import Any

import numpy as np
from markdown import table

Json = dict[str, Any]
UNITS = {"M": "kg", "B": "N s/m", "K": "N/m"}
CORNERS = ((0, 0), (0, 1), (1, 0), (1, 1))
AXES = "xy"


def domains(document: Json) -> list[str]:
    """Time domain beside spectral, as `impid-host fit` states them."""
    rows = []
    truths = {name: part["truth"] for name, part in document["arrays"].items()} | {
        "arm": document["arm"]["truth"]
    }
    total = np.zeros(3, dtype=int)
    for study, part in document["fit"].items():
        for load, methods in part["loads"].items():
            true = np.array(truths[load]).ravel()
            for method, own in methods.items():
                quantities = own["against_time_domain"]["quantities"]
                z = np.array([q["standard_errors_apart"] for q in quantities.values()])
                off = [
                    np.array([q[d] - t for q, t in zip(quantities.values(), true, strict=True)])
                    / np.array([q[f"{d}_sd"] for q in quantities.values()])
                    for d in ("time_domain", "spectral")
                ]
                beyond = [int(np.sum(np.abs(v) > 1.96)) for v in (z, *off)]
                total += beyond
                worst = int(np.argmax(np.abs(z)))
                rows.append(
                    [
                        study,
                        load,
                        "virtual" if method == "method1" else "physical",
                        f"{abs(z[worst]):.1f} in {list(quantities)[worst]}",
                        *(f"{count} of {len(z)}" for count in beyond),
                    ]
                )
    count = 12 * len(rows)
    return [
        "## Time domain against spectral",
        "",
        "By `impid-host fit STUDY` alone: the same trials through the time-domain regression (4.5 Hz) and through the "
        "spectral one (0 to 10 Hz), full matrices; differences in standard errors of both together, and either domain against "
        "the truth in its own. Both share their data, so fewer than 5 % of the differences should lie beyond 1.96.",
        "",
        *table(
            [
                "study",
                "load",
                "force sensor",
                "largest difference (standard errors)",
                "apart beyond 1.96",
                "time domain off the truth",
                "spectral off the truth",
            ],
            rows,
        ),
        "",
        f"Altogether {total[0]} of {count} differences lie beyond 1.96 ({100 * total[0] / count:.1f} %); of the time domain's "
        f"values {100 * total[1] / count:.1f} % lie that far off the truth, of the spectral ones {100 * total[2] / count:.1f} %.",
        "",
    ]


def virtual(document: Json) -> list[str]:
    """The spectral method with and without a force sensor."""
    part = document["fit"]["palazzolo-virtual"]["loads"]
    alone = document["fit_without_force"]["loads"]
    truth = {"arm": document["arm"]["truth"], "sa1": document["arrays"]["sa1"]["truth"]}
    rows, inside, apart, same = [], {"method1": 0, "method2": 0}, [], 0.0
    for load in part:
        for m, matrix in enumerate("MBK"):
            for i, j in CORNERS:
                true = truth[load][m][i][j]
                cells, sds, values = [], [], []
                for method in ("method2", "method1"):
                    own = part[load][method][matrix]
                    low, high = own["ci95"][i][j]
                    inside[method] += low <= true <= high
                    sds.append((high - low) / 3.92)
                    values.append(own["value"][i][j])
                    cells.append(f"{own['value'][i][j]:.5g} ± {(high - low) / 2:.2g}")
                z = (values[1] - values[0]) / float(np.hypot(*sds))
                apart.append(z)
                same = max(same, abs(alone[load]["method1"][matrix]["value"][i][j] / values[1] - 1))
                rows.append(
                    [
                        f"{load} {matrix}{AXES[i]}{AXES[j]} ({UNITS[matrix]})",
                        f"{true:.4g}",
                        *cells,
                        f"{z:+.1f}",
                    ]
                )
    worst = max(np.abs(apart))
    return [
        "## Without a force sensor",
        "",
        "`palazzolo-virtual`: six free trials identify the robot, then arm and array are shaken. Physical sensor beside virtual "
        "sensor, spectral weighted fit with 95 % intervals; those of the virtual sensor hold the robot parameters' "
        "uncertainty. The same study with `fx, fy` taken out of every `robot.csv`, through `impid-host fit`, gives the virtual "
        f"sensor's numbers to {same:.0e} relative.",
        "",
        *table(["", "true", "physical sensor", "virtual sensor", "apart (standard errors)"], rows),
        "",
        f"Of {len(rows)} intervals {inside['method2']} (physical) and {inside['method1']} (virtual) hold the truth; the sensors "
        f"differ by at most {worst:.1f} standard errors, {sum(np.abs(apart) > 1.96)} of {len(rows)} beyond 1.96.",
        "",
    ]


def perturbations(part: Json) -> list[str]:
    """Seed search and modified perturbation."""
    rows = []
    for load, own in part.items():
        for label, one in own["found"].items():
            rows.append(
                [
                    load,
                    label,
                    f"{one['mean_force_coherence']:.3f}",
                    f"{one['worst_force_coherence']:.2f}",
                    f"{one['command_rms_N']:.1f} / {one['command_peak_N']:.0f}",
                    f"{one['force_rms_N']:.2f}",
                    f"{100 * one['median_random_error']['direct']:.2g} / "
                    f"{100 * one['median_random_error']['derived']:.2g}",
                ]
            )
    own = next(iter(part.values()))
    searched = own["command_coherence"]["searched"]
    return [
        "## Seeds and the modified perturbation",
        "",
        f"Seed search: the best of 100 seeds has a mean coherence of {searched:.3f} between the two commands over 0 to 15 Hz "
        f"(5 segments), an unsearched pair {own['chance']:.3f}. Modified perturbation: F_Δ,new = T_model⁻¹ F_Δ,old with the "
        "eight-state model of robot, hold and load, gain limited to 10; the load once guessed as an isotropic arm (1.2 kg, "
        "8 N s/m, 140 N/m), once known. All commands have 4 N rms: T_model⁻¹ asks for two to eight times the force it delivers, and "
        "with more the arm is thrown to where the robot is stretched out, or the accelerometer (1.7 g) saturates. Coherence between the two *interaction* forces, one trial each, 0 to 10 Hz:",
        "",
        *table(
            [
                "load",
                "perturbation",
                "mean γ²",
                "largest γ²",
                "command rms / peak (N)",
                "force on the load, rms (N)",
                "median random error, direct / derived (%)",
            ],
            rows,
        ),
        "",
        "![Coherence between the forces](second_paper_perturbation.png)",
        "",
    ]


def periodic(part: Json) -> list[str]:
    """Best linear approximation and detection lines."""
    rows = []
    for hidden, own in part.items():
        for method in ("physical sensor", "virtual sensor"):
            one = own[method]
            axes = one["axes"]
            rows.append(
                [
                    hidden,
                    method,
                    f"{one['noise_percent']:.2g}",
                    f"{one['distortion_percent']:.2g} (p = {one['p_value']:.1g})",
                    *(
                        " / ".join(f"{a[f'{kind}_percent']:.2g} (p = {a[f'p_{kind}']:.1g})" for a in axes)
                        for kind in ("odd", "even")
                    ),
                    axes[1]["verdict"],
                ]
            )
    first = next(iter(part.values()))
    return [
        "## Noise and nonlinear distortion told apart",
        "",
        f"`impid-host design multisine --rms 4` (four realisations of two experiments, {first['lines']} odd lines of a 10 s "
        "period below 15 Hz, one of four left out at random), played on the arm after six free trials; `impid-host fit` "
        "recognises the period. Best linear approximation of the compliance: noise left on its mean, scatter of one "
        "realisation by nonlinear distortion, in % of its rms; and what the force does not explain at the lines that were not "
        "excited (x / y), in % of the excited ones.",
        "",
        *table(
            [
                "hidden",
                "force by",
                "noise (%)",
                "distortion (%)",
                "odd lines, x / y (%)",
                "even lines, x / y (%)",
                "verdict along y",
            ],
            rows,
        ),
        "",
        "A cubic spring in the load shows by either sensor. Friction in the robot does not touch the load's own response, and "
        "the physical sensor sees none; the virtual sensor, whose robot model has no Coulomb friction, shows it as odd "
        "distortion.",
        "",
        "![Detection lines](second_paper_detection.png)",
        "",
    ]


def coverage(coverage: Json | None) -> list[str]:
    """How often the intervals hold the truth."""
    if coverage is None:
        return []
    names = [f"{m}{i}{j}" for m in "MBK" for i in AXES for j in AXES]
    rows = [
        [
            case,
            f"{own['all']:.1f}",
            f"{min(own['each']):.1f} ({names[int(np.argmin(own['each']))]})",
            f"{max(own['each']):.1f} ({names[int(np.argmax(own['each']))]})",
            f"{np.mean(own['stated_over_scatter']):.2f}",
        ]
        for case, own in coverage["summary"].items()
    ]
    return [
        "## Coverage of the intervals",
        "",
        f"`python bench/spectral_coverage.py {coverage['count']}`: {coverage['count']} studies of six trials on an exact linear "
        "arm that pushes by itself (0.5 N below 3 Hz), share of 95 % intervals that hold the truth, %.",
        "",
        *table(
            ["", "all twelve", "lowest parameter", "highest parameter", "stated deviation over scatter"], rows
        ),
        "",
    ]
