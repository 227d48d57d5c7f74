"""`impid-host design`: what to shake the robot with, as CSV for its controller."""

from pathlib import Path
from typing import TYPE_CHECKING

import click
import numpy as np

from impid_host.cli.design_trial import trial
from impid_host.design.reference import (
    Plan,
    design_reference,
    low_crest_multisine,
    odd_random_multisine,
    ten_sinusoids,
)
from impid_host.errors import InputError
from impid_host.robot.model import ROBOTS, RobotModel, robot_model
from impid_host.study.csv_table import write_columns
from impid_host.study.model import Setup
from impid_host.study.setup_file import read_setup

if TYPE_CHECKING:
    from impid_host.design.interaction import Contact

KINDS = {
    "ten-sinusoids": ten_sinusoids,
    "odd-multisine": odd_random_multisine,
    "low-crest-multisine": low_crest_multisine,
}


@click.group()
def command() -> None:
    """Design an excitation and write it as CSV for the robot's controller."""


command.add_command(trial)


@command.command()
@click.option(
    "--setup", "setup_path", type=click.Path(path_type=Path), required=True, help="The study's setup.toml."
)
@click.option("--out", type=click.Path(path_type=Path), required=True, help="CSV to write.")
@click.option("--kind", type=click.Choice(list(KINDS)), default="ten-sinusoids", show_default=True)
@click.option(
    "--centre", type=float, multiple=True, metavar="DEG", help="Centre of each joint; default 45 each."
)
@click.option(
    "--range",
    "range_",
    type=click.FloatRange(0, min_open=True),
    default=40.0,
    show_default=True,
    metavar="DEG",
)
@click.option(
    "--upper", type=click.FloatRange(0, min_open=True), default=2.0, show_default=True, metavar="HZ"
)
@click.option(
    "--period", type=click.FloatRange(0, min_open=True), default=50.0, show_default=True, metavar="S"
)
@click.option("--periods", type=click.IntRange(1), default=1, show_default=True, help="Steady periods.")
@click.option(
    "--fade", type=click.FloatRange(0), default=3.0, show_default=True, metavar="S", help="From and to rest."
)
@click.option(
    "--speed-limit", type=click.FloatRange(0, min_open=True), metavar="RAD/S", help="Of every joint."
)
@click.option(
    "--rate", type=click.FloatRange(0, min_open=True), default=1000.0, show_default=True, metavar="HZ"
)
@click.option(
    "--candidates", type=click.IntRange(1), default=50, show_default=True, help="Random references to try."
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
def reference(
    setup_path: Path,
    out: Path,
    kind: str,
    centre: tuple[float, ...],
    range_: float,
    upper: float,
    period: float,
    periods: int,
    fade: float,
    speed_limit: float | None,
    rate: float,
    candidates: int,
    seed: int,
) -> None:
    """Joint reference that tells most about the robot's parameters within the limits.

    The CSV has the columns t (s), and theta, omega, theta_dd of each joint (rad, rad/s, rad/s^2), and steady
    (0/1).

    \b
    Example:
      impid-host design reference --setup study/setup.toml --out reference.csv
    """
    model = _model(setup_path, read_setup(setup_path))
    centre_deg = centre or (45.0,) * model.joints
    if len(centre_deg) != model.joints:
        raise click.UsageError(
            f"--centre was given {len(centre_deg)} times, the robot has {model.joints} joints"
        )
    plan = Plan(
        centre=np.deg2rad(np.array(centre_deg)),
        range_=np.full(model.joints, np.deg2rad(range_)),
        period_s=period,
        periods=periods,
        fade_s=fade,
        fs=rate,
        speed_limit=None if speed_limit is None else np.full(model.joints, speed_limit),
    )
    design = design_reference(model, plan, KINDS[kind](period, upper), candidates=candidates, seed=seed)
    columns = {"t": design.t}
    for j in range(model.joints):
        columns[f"theta{j + 1}"] = design.theta[:, j]
    for j in range(model.joints):
        columns[f"omega{j + 1}"] = design.omega[:, j]
    for j in range(model.joints):
        columns[f"theta_dd{j + 1}"] = design.theta_dd[:, j]
    _write(out, {**columns, "steady": design.steady.astype(np.uint8)})
    click.echo(f"{out}: {design}")
    for name, unit, sd in zip(
        model.parameter_names, model.parameter_units, design.information.predicted_sd, strict=True
    ):
        click.echo(f"  {name}: ± {sd:.2g} {unit} for white torque noise of 1 N m at {rate:g} Hz")


@command.command()
@click.option("--out", type=click.Path(path_type=Path), required=True, help="CSV to write.")
@click.option(
    "--rms", type=click.FloatRange(0, min_open=True), required=True, metavar="N", help="Of each axis."
)
@click.option("--axes", type=click.IntRange(1, 6), default=2, show_default=True)
@click.option(
    "--duration", type=click.FloatRange(0, min_open=True), default=50.0, show_default=True, metavar="S"
)
@click.option("--rate", type=click.FloatRange(100), default=500.0, show_default=True, metavar="HZ")
@click.option(
    "--cutoff", type=click.FloatRange(0, min_open=True), default=15.0, show_default=True, metavar="HZ"
)
@click.option("--candidates", type=click.IntRange(1), default=100, show_default=True, help="Seeds to try.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="First seed.")
@click.option(
    "--modify-for",
    "setup_path",
    type=click.Path(path_type=Path),
    help="setup.toml with [prior] alpha: modify the commands so that the arm gets these forces.",
)
@click.option("--angles", type=float, nargs=2, default=(45.0, 45.0), show_default=True, metavar="DEG DEG")
@click.option("--hold", type=float, nargs=2, default=(60.0, 4.0), show_default=True, metavar="KP KD")
@click.option(
    "--arm",
    type=float,
    nargs=3,
    default=(1.2, 8.0, 140.0),
    show_default=True,
    metavar="M B K",
    help="Assumed, kg, N s/m, N/m.",
)
@click.option("--max-gain", type=click.FloatRange(1), default=10.0, show_default=True)
def perturbation(
    out: Path,
    rms: float,
    axes: int,
    duration: float,
    rate: float,
    cutoff: float,
    candidates: int,
    seed: int,
    setup_path: Path | None,
    angles: tuple[float, float],
    hold: tuple[float, float],
    arm: tuple[float, float, float],
    max_gain: float,
) -> None:
    """Force perturbations of low mutual coherence for a stochastic trial.

    The CSV has the columns t (s) and fdx, fdy, ... (N), as robot.csv logs them.

    \b
    Example:
      impid-host design perturbation --rms 4 --out perturbation.csv
    """
    from impid_host.design.interaction import modified_perturbation  # noqa: PLC0415  (with it spectra)
    from impid_host.design.perturbation import design_perturbation  # noqa: PLC0415

    if setup_path is not None and axes != 2:
        raise click.UsageError("--modify-for needs the two axes of a planar robot")
    # What the setup lacks is said before a hundred candidates are tried.
    contact = None if setup_path is None else _contact(setup_path, angles, hold, arm)
    try:
        design = design_perturbation(
            rms,
            axes=axes,
            duration_s=duration,
            fs=rate,
            cutoff_Hz=cutoff,
            candidates=candidates,
            first_seed=seed,
        )
    except ValueError as error:
        raise click.UsageError(str(error)) from error
    force, modified = design.force, ""
    if contact is not None:
        force = modified_perturbation(force, rate, contact, max_gain=max_gain, upper_Hz=1.5 * cutoff)
        peak = np.max(np.abs(force))
        modified = f"  modified for the arm: peak {peak:.1f} N; check it against the robot's limits"
    labels = ("fdx", "fdy", "fdz") if axes <= 3 else tuple(f"fd{k + 1}" for k in range(axes))
    _write(out, {"t": design.t, **{labels[k]: force[:, k] for k in range(axes)}})
    click.echo(f"{out}: {design}")
    if modified:
        click.echo(modified)


@command.command()
@click.option(
    "--out", type=click.Path(path_type=Path), required=True, help="Folder for one CSV per experiment."
)
@click.option(
    "--rms", type=click.FloatRange(0, min_open=True), required=True, metavar="N", help="Of each axis."
)
@click.option("--axes", type=click.IntRange(1, 3), default=2, show_default=True)
@click.option("--realisations", type=click.IntRange(2), default=4, show_default=True)
@click.option(
    "--period", type=click.FloatRange(0, min_open=True), default=10.0, show_default=True, metavar="S"
)
@click.option("--periods", type=click.IntRange(2), default=4, show_default=True, help="Steady periods.")
@click.option("--lead-in", type=click.IntRange(0), default=1, show_default=True, help="Periods before them.")
@click.option(
    "--upper", type=click.FloatRange(0, min_open=True), default=15.0, show_default=True, metavar="HZ"
)
@click.option("--rate", type=click.FloatRange(100), default=500.0, show_default=True, metavar="HZ")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
def multisine(
    out: Path,
    rms: float,
    axes: int,
    realisations: int,
    period: float,
    periods: int,
    lead_in: int,
    upper: float,
    rate: float,
    seed: int,
) -> None:
    """Periodic force perturbations that tell noise from nonlinear distortion.

    Writes force_r<realisation>_e<experiment>.csv with the columns t (s), fdx, fdy, ... (N) and steady (0/1).

    \b
    Example:
      impid-host design multisine --rms 4 --out multisine/
    """
    from impid_host.design.force_multisine import design_force_multisines  # noqa: PLC0415  (with it spectra)

    design = design_force_multisines(
        rms,
        axes=axes,
        realisations=realisations,
        period_s=period,
        upper_Hz=upper,
        fs=rate,
        lead_in=lead_in,
        periods=periods,
        seed=seed,
    )
    samples = design.force.shape[2]
    for r in range(realisations):
        for e in range(axes):
            force = design.command(r, e)
            row = np.arange(len(force))
            columns = {
                "t": row / rate,
                **{name: force[:, k] for k, name in enumerate(("fdx", "fdy", "fdz")[:axes])},
            }
            steady = (row >= lead_in * samples).astype(np.uint8)
            _write(out / f"force_r{r + 1}_e{e + 1}.csv", {**columns, "steady": steady})
    click.echo(f"{out}: {design}")


def _model(path: Path, setup: Setup) -> RobotModel:
    if ROBOTS[setup.robot.model].described:
        raise InputError(
            path, "design needs the robot's own model, not a URDF", "use a planar model or slide-1d"
        )
    return robot_model(setup.robot)


def _contact(
    path: Path, angles_deg: tuple[float, float], hold: tuple[float, float], arm: tuple[float, float, float]
) -> "Contact":
    """Robot at rest at the test location, from its identified parameters, against an isotropic arm."""
    from impid_host.design.interaction import Contact  # noqa: PLC0415  (with it spectra)

    setup = read_setup(path)
    model = _model(path, setup)
    if model.joints != 2 or setup.prior_alpha is None:
        raise InputError(
            path,
            "the modified perturbation needs a two-joint robot with [prior] alpha",
            "identify the robot with `impid-host fit` and enter its alpha",
        )
    if len(setup.prior_alpha) != len(model.parameter_names):
        what = (
            f"[prior] alpha has {len(setup.prior_alpha)} numbers, {model.name} {len(model.parameter_names)}"
        )
        raise InputError(path, what, f"give {', '.join(model.parameter_names)}")
    theta = np.deg2rad(np.array([angles_deg]))
    alpha = np.array(setup.prior_alpha)
    still = np.zeros((1, 2))
    # Friction as the regressor states it: the torque of a unit speed less the torque of none.
    at_rest = model.regressor(theta, still, still)[0] @ alpha
    columns = [model.regressor(theta, np.eye(2)[[j]] * 1e-6, still)[0] @ alpha - at_rest for j in range(2)]
    kp, kd = hold
    mass, damping, stiffness = (value * np.eye(2) for value in arm)
    return Contact(
        inertia=model.inertia(theta, alpha)[0],
        friction=np.stack(columns, axis=1) / 1e-6,
        jacobian=model.jacobian(theta)[0],
        kp=kp,
        kd=kd,
        M=mass,
        B=damping,
        K=stiffness,
    )


def _write(out: Path, columns: dict[str, np.ndarray]) -> None:
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        write_columns(out, columns)
    except OSError as error:
        raise InputError(out, f"cannot be written ({error.strerror})", "choose another --out") from error
