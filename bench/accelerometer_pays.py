"""When the accelerometer pays: M and K with and without it, over encoders, cut-offs, rates and a capstan.

    python bench/accelerometer_pays.py [STUDIES] [--markdown FILE]

The first paper's protocol in closed form (scripts/validate/footnote_two.py): two free trials and one with a mass of
0.539 kg on springs, 50 s each, torque noise 0.02 N m and accelerometer noise 0.015 m/s² rms per sample. Each study
is fitted twice by Method 1, from the same encoders and torques: accelerations from the accelerometer, or from the
angles. `--markdown` writes JSON and a figure beside the page.
"""

import json
import sys
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "scripts" / "validate"))
from footnote_two import LOADS, SOURCES, STRUCTURE, Condition, Record, prepared, recorded, resonance_hz  # noqa: E402
from impid_host.errors import UndeterminedError  # noqa: E402
from impid_host.impedance.identify import identify_load, identify_robot  # noqa: E402
from impid_host.impedance.loads import mass_spring  # noqa: E402
from impid_host.impedance.rows import Split  # noqa: E402
from impid_host.signals.align import AccelerationSource  # noqa: E402

COUNTS = (400_000, 10_000, 2_000, 1_000, 500)
CAPSTANS = (20_000.0, 5_000.0, 1_000.0)
SETTINGS = {
    "motion to 2 Hz, cut-off 4.5 Hz, 1 kHz": {"band_Hz": 2.0, "cutoff_Hz": 4.5, "rate_Hz": 1000.0},
    "motion to 2 Hz, cut-off 12 Hz, 1 kHz": {"band_Hz": 2.0, "cutoff_Hz": 12.0, "rate_Hz": 1000.0},
    "motion to 5 Hz, cut-off 12 Hz, 1 kHz": {"band_Hz": 5.0, "cutoff_Hz": 12.0, "rate_Hz": 1000.0},
    "motion to 2 Hz, cut-off 4.5 Hz, 200 Hz": {"band_Hz": 2.0, "cutoff_Hz": 4.5, "rate_Hz": 200.0},
}
# Without it the error is larger by more than this factor: then it pays.
PAYS = 1.5
QUANTITIES = ("M", "K")


def places() -> Iterator[Condition]:
    """Encoders at rigid joints, ever coarser; then fine ones on motors behind an ever softer capstan."""
    for counts in COUNTS:
        yield Condition(f"at the joint, {counts} counts/turn", counts_per_rev=counts)
    for k in CAPSTANS:
        soft = Condition("", capstan_Nm_rad=k)
        yield replace(soft, name=f"at the motor, capstan {k:g} N m/rad ({resonance_hz(k):.0f} Hz)")


def records(condition: Condition, seed: int) -> list[Record]:
    """Two free trials and one under load."""
    rng = np.random.default_rng([seed, 11])
    return [recorded(rng, condition, load) for load in (None, None, LOADS[0])]


def errors(
    condition: Condition, source: AccelerationSource, study: list[Record]
) -> dict[str, list[float]] | None:
    """Of M and K: error and half its 95 % interval, both in % of the truth; K's worse diagonal entry."""
    chain, split, load = condition.signal_chain(), Split(), LOADS[0]
    *free, loaded = [prepared(record, source, condition) for record in study]
    try:
        robot = identify_robot(free, STRUCTURE, chain, split).parameters
        fit = identify_load([loaded], mass_spring(), chain, split, robot=robot, handle_mass_kg=0.0)
    except UndeterminedError:
        return None
    found: dict[str, list[float]] = {"M": [], "K": []}
    entries = ((fit.M, 0, load[0], "M"), (fit.K, 0, load[1], "K"), (fit.K, 1, load[2], "K"))
    for quantity, k, truth, name in entries:
        half = 0.5 * float(np.ptp(quantity.ci95[k, k]))
        own = [100 * (float(quantity.value[k, k]) / truth - 1), 100 * half / truth]
        if not found[name] or abs(own[0]) > abs(found[name][0]):
            found[name] = own
    return found


def row(place: Condition, setting: dict[str, float], studies: int) -> dict[str, Any]:
    """One cell of the sweep: rms error, mean half width and coverage, by source and quantity."""
    condition = replace(place, **setting)  # type: ignore[arg-type]
    result: dict[str, Any] = {"condition": asdict(condition)}
    made = [records(condition, seed) for seed in range(studies)]
    for source in SOURCES:
        runs = [errors(condition, source, study) for study in made]
        kept = [run for run in runs if run is not None]
        result[source] = {"refused": studies - len(kept)}
        for name in QUANTITIES if kept else ():
            error, half = np.array([run[name] for run in kept]).T
            result[source][name] = {
                "rms_error_percent": float(np.sqrt(np.mean(error**2))),
                "half_width_percent": float(np.mean(half)),
                "covered": float(np.mean(np.abs(error) <= half)),
            }
    return result


def gain(found: dict[str, Any], name: str) -> float | None:
    """How many times larger the rms error is without the accelerometer; None where one of them was refused."""
    with_it, without = (found[source].get(name) for source in SOURCES)
    if with_it is None or without is None:
        return None
    return float(without["rms_error_percent"] / max(with_it["rms_error_percent"], 1e-300))


def _cell(found: dict[str, Any], source: str, name: str) -> str:
    own = found[source].get(name)
    if own is None:
        return "refused"
    words = (
        f"{own['rms_error_percent']:.2f} (± {own['half_width_percent']:.2f}, {100 * own['covered']:.0f} %)"
    )
    return words + (f", {found[source]['refused']} refused" if found[source]["refused"] else "")


def _verdict(found: dict[str, Any], name: str) -> str:
    times = gain(found, name)
    if times is None:
        return "?"
    if times > PAYS:
        return f"**{times:.1f}**"
    return f"{times:.2f}"


def page(rows: dict[str, dict[str, Any]], studies: int) -> str:
    """The Markdown page."""
    lines = [
        "# When the accelerometer pays",
        "",
        f"`python bench/accelerometer_pays.py {studies}`: the first paper's protocol in closed form, {studies} studies a "
        "row (two free trials, one with 0.539 kg on springs of 422 and 213 N/m, 50 s each; torque noise 0.02 N m, "
        "accelerometer noise 0.015 m/s², rms per sample). Every study is fitted twice by Method 1, from the same "
        "encoders and torques: with the accelerometer, and from the angles alone.",
        "",
        "A cell is the rms error in % of the truth; in brackets half the 95 % interval and in how many studies "
        "the interval holds the truth. The last columns say how many times larger the error is without the accelerometer; "
        f"bold where it pays, more than {PAYS:g} times. Below 1 it does harm. Of K the worse diagonal entry counts, so that 95 % "
        "intervals hold it in about 90 % of studies.",
        "",
        "![Error of M and K with and without the accelerometer](accelerometer_pays.png)",
    ]
    for setting, own in rows.items():
        lines += [
            "",
            f"## {setting[:1].upper()}{setting[1:]}",
            "",
            "| encoders | M with | M without | K with | K without | M, times | K, times |",
            "| --- | --- | --- | --- | --- | --- | --- |",
        ]
        for place, found in own.items():
            cells = [_cell(found, source, name) for name in QUANTITIES for source in SOURCES]
            times = [_verdict(found, name) for name in QUANTITIES]
            lines.append(f"| {place} | {' | '.join([*cells, *times])} |")
    return "\n".join([*lines, "", *conclusion(rows)])


def conclusion(rows: dict[str, dict[str, Any]]) -> list[str]:
    """Where it pays, from the numbers."""
    cells = [
        (s, p, name, gain(f, name)) for s, own in rows.items() for p, f in own.items() for name in QUANTITIES
    ]
    known = [(s, p, name, times) for s, p, name, times in cells if times is not None]
    lines = ["## What follows", ""]
    for name, what in (("M", "the mass"), ("K", "the stiffness")):
        own = [(s, p, t) for s, p, n, t in known if n == name]
        pays = [p for _, p, t in own if t > PAYS]
        harms = [p for _, p, t in own if t < 1 / PAYS]
        lines.append(
            f"- For {what} it pays in {len(pays)} of {len(own)} rows, makes no difference of that size in "
            f"{len(own) - len(pays) - len(harms)}, and does harm in {len(harms)}."
        )
        if pays:
            lines.append(f"    - pays: {_listed(pays)}")
        if harms:
            lines.append(f"    - harms: {_listed(harms)}")
    return [*lines, ""]


def _listed(found: list[str]) -> str:
    return "; ".join(f"{place} ({found.count(place)})" for place in dict.fromkeys(found))


def draw(rows: dict[str, dict[str, Any]], path: Path) -> None:
    """Rms error over encoder resolution (upper row) and over the capstan's resonance (lower row)."""
    figure = Figure(figsize=(7.4, 5.2), layout="constrained")
    axes = figure.subplots(2, 2, sharey="col")
    colours = ("#0072b2", "#d55e00", "#009e73", "#7a5195")
    for column, name in enumerate(QUANTITIES):
        for colour, (setting, own) in zip(colours, rows.items(), strict=True):
            for source, style in zip(SOURCES, ("-", ":"), strict=True):
                for panel, stiff in ((axes[0, column], False), (axes[1, column], True)):
                    points = [
                        (
                            resonance_hz(f["condition"]["capstan_Nm_rad"])
                            if stiff
                            else f["condition"]["counts_per_rev"],
                            f[source][name]["rms_error_percent"],
                        )
                        for f in own.values()
                        if bool(f["condition"]["capstan_Nm_rad"]) is stiff and name in f[source]
                    ]
                    label = f"{setting}: {'with' if style == '-' else 'without'}"
                    panel.loglog(
                        *zip(*points, strict=True),
                        ls=style,
                        color=colour,
                        marker="o",
                        ms=3,
                        lw=1,
                        label=label,
                    )
        axes[0, column].set(
            title=f"{name}, encoders at rigid joints", xlabel="counts per turn", ylabel="rms error (%)"
        )
        axes[1, column].set(
            title=f"{name}, encoders at motors",
            xlabel="resonance on the capstan (Hz)",
            ylabel="rms error (%)",
        )
    for panel in axes.ravel():
        panel.spines[["top", "right"]].set_visible(False)
        panel.grid(color="#e4e4e4", lw=0.6)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2, frameon=False, fontsize=7)
    figure.savefig(path, dpi=140)


def main() -> None:
    words = sys.argv[1:]
    to = Path(words.pop(words.index("--markdown") + 1)) if "--markdown" in words else None
    words = [word for word in words if word != "--markdown"]
    studies = int(words[0]) if words else 10
    rows: dict[str, dict[str, Any]] = {}
    for setting, values in SETTINGS.items():
        rows[setting] = {}
        for place in places():
            rows[setting][place.name] = row(place, values, studies)
            print(setting, "|", place.name, file=sys.stderr, flush=True)
    text = page(rows, studies)
    print(text)
    if to is not None:
        to.write_text(text, encoding="utf-8")
        document = {"command": f"python bench/accelerometer_pays.py {studies}", "rows": rows}
        to.with_suffix(".json").write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
        draw(rows, to.with_suffix(".png"))


if __name__ == "__main__":
    main()
