"""`impid-host fit`: the robot, then the load or arm, of a study. What it does is in `fit_run`."""

from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click

from impid_host.cli.inputs import load_inputs
from impid_host.cli.pair import PAIR
from impid_host.cli.window import window_option
from impid_host.impedance.estimators.estimated import ESTIMATORS, EstimatorWish
from impid_host.robot.terms import TERMS
from impid_host.signals.chain import CHAINS, DEFAULT

if TYPE_CHECKING:
    from impid_host.recording.records import Window

REFLEX = "load.delay"


@click.command()
@click.argument(
    "paths", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="STUDY|RECORDING..."
)
@click.option(
    "--robot-log",
    multiple=True,
    type=click.Path(path_type=Path),
    help="Robot log (CSV) of each recording, in order.",
)
@click.option("--setup", type=click.Path(path_type=Path), help="setup.toml that goes with recordings.")
@window_option
@click.option(
    "--chain",
    type=click.Choice(list(CHAINS)),
    default="default",
    show_default=True,
    help="Signal chain: ours, as published by Dyck and Tavakoli, or as the EMPS benchmark's authors did it.",
)
@click.option(
    "--acceleration",
    type=click.Choice(["accelerometer", "angles"]),
    help="Where accelerations come from; by default the accelerometer where there is one.",
)
@click.option(
    "--cutoff",
    type=click.FloatRange(0.5, 200),
    metavar="HZ",
    help="Cut-off of the default chain; by default twice the band of the motion, 4.5 Hz at least.",
)
@click.option(
    "--with",
    "terms",
    multiple=True,
    type=click.Choice([*TERMS, REFLEX]),
    metavar="EFFECT",
    help=f"Add a term to the robot model; may be repeated. One of {', '.join(TERMS)}; or {REFLEX}, the late "
    "stretch reflex of a limb on a joint-1d.",
)
@click.option(
    "--estimator",
    type=click.Choice(list(ESTIMATORS)),
    default="least-squares",
    show_default=True,
    help="instruments: the motion by the simulated model (where the log has theta1_ref or fdx, fdy) or the "
    "angles, against noise in the regressors; output-error: the model simulated; auto: least squares where "
    "they are shown to agree with instruments, else instruments.",
)
@click.option(
    "--validate",
    type=click.FloatRange(0),
    default=10.0,
    show_default=True,
    metavar="SECONDS",
    help="Hold out the end of each trial for validation (at most a fifth); 0 fits everything.",
)
@click.option(
    "--model",
    "model_file",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="Take the effects of a saved model (`diagnose --save-model`) out of the signals first.",
)
@click.option(
    "--saved-robot", is_flag=True, help="With --model: its robot parameters, even if trials are free."
)
@click.option(
    "--save-model",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="Write robot and loads as a model without effects, for `impid-host judge`.",
)
@click.option(
    "--physical", is_flag=True, help="Also give the robot's links inertias that a body can have (URDF)."
)
@click.option(
    "--urdf",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="With --physical: write the robot's URDF with those inertias.",
)
@click.option(
    "--varying",
    metavar="time|posture|since:COLUMN|COLUMN",
    help="Also give K, B and x0 as curves with 95 % bands: over time (each trial by itself), over the slow "
    "part of the posture, over a column of robot.csv, or over the time since a column last rose.",
)
@click.option("--constrain", is_flag=True, help="Also give M and K of arms symmetric and positive definite.")
@click.option("--limb", type=PAIR, metavar="UPPER,FORE", help="Limb lengths, m: also give joint impedance.")
@click.option("--shoulder", type=PAIR, metavar="X,Y", help="Where the shoulder is, m, in the robot's frame.")
@click.option("--side", type=click.Choice(["right", "left"]), default="right", help="Which arm it is.")
@click.option(
    "--json", "json_to", metavar="FILE|-", help="Also write the result as JSON (- for standard output)."
)
@click.option(
    "--figures", type=click.Path(path_type=Path, file_okay=False), help="Write figures (PNG) to this folder."
)
def command(
    paths: tuple[Path, ...],
    robot_log: tuple[Path, ...],
    setup: Path | None,
    window: "Window | None",
    chain: str,
    acceleration: Literal["accelerometer", "angles"] | None,
    cutoff: float | None,
    terms: tuple[str, ...],
    estimator: EstimatorWish,
    validate: float,
    model_file: Path | None,
    saved_robot: bool,
    save_model: Path | None,
    physical: bool,
    urdf: Path | None,
    varying: str | None,
    constrain: bool,
    limb: tuple[float, float] | None,
    shoulder: tuple[float, float] | None,
    side: str,
    json_to: str | None,
    figures: Path | None,
) -> None:
    """Identify the robot, then the load or arm, with 95 % intervals.

    The robot's parameters come from the free trials (or from [prior] in setup.toml when there are none);
    then every load, all its trials together, by Method 1 (virtual force sensor) and, where the log has
    forces, Method 2 (physical sensor). Stochastic trials also go through the spectral method, with a
    statement of where the two disagree. What a trial is stands in its trial.toml.

    \b
    Examples:
      impid-host fit study/
      impid-host fit study/ --json result.json --figures figures/
      impid-host fit panda/ --with friction.coulomb --with actuator.offset --physical
      impid-host fit arm_study/ --constrain --limb 0.30,0.33 --shoulder 0.37,-0.50
      impid-host fit next_study/ --model model.json
      impid-host fit study/ --save-model plain.json
      impid-host fit study/ --estimator auto
      impid-host fit arm_study/ --varying time --figures figures/
      impid-host fit ankle/ --with load.delay --cutoff 40 --validate 20
      impid-host fit emps/ --chain emps --with friction.coulomb --with actuator.offset --validate 0
    """
    if limb is not None and shoulder is None:
        raise click.UsageError("--limb needs to know where the shoulder is: add --shoulder X,Y")
    if limb is not None and min(limb) <= 0:
        raise click.UsageError("--limb: lengths must be positive, in metres")
    if save_model is not None and model_file is not None:
        raise click.UsageError("--save-model writes a model without effects: leave --model out")
    if urdf is not None and not physical:
        raise click.UsageError("--urdf writes inertias that a body can have: add --physical")
    if model_file is not None and chain != DEFAULT.name:
        raise click.UsageError("--model goes with --chain default: its effects act on those signals")
    schedule = None
    if varying is not None:
        from impid_host.impedance.varying.schedule import Schedule  # noqa: PLC0415  (few ask for it)

        schedule = Schedule(varying)
    study = load_inputs(paths, robot_log, setup, () if schedule is None else schedule.columns, window)
    from impid_host.cli.fit_run import Wishes, run  # noqa: PLC0415  (half a second in all)

    wishes = Wishes(
        chain=chain,
        acceleration=acceleration,
        cutoff_hz=cutoff,
        terms=tuple(term for term in terms if term != REFLEX),
        reflex=REFLEX in terms,
        estimator=estimator,
        held_out_s=validate,
        model=model_file,
        keep_robot=saved_robot,
        save_model=save_model,
        physical=physical,
        urdf=urdf,
        varying=schedule,
        constrain=constrain,
        limb=None if limb is None or shoulder is None else (limb, shoulder, side),
        json_to=json_to,
        figures=figures,
    )
    run(study, wishes)
