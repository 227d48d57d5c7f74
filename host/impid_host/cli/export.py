"""`impid-host export`: recordings and torque logs into a study folder."""

import re
from pathlib import Path
from typing import Literal

import click

from impid_host.calibration.applied import apply, read_calibration, with_calibration
from impid_host.cli.checked import offer_check
from impid_host.errors import InputError
from impid_host.extras import need
from impid_host.recording.export.origin import write_origin
from impid_host.recording.export.tables import write_mat, write_parquet
from impid_host.recording.reader import Recording, read_recording
from impid_host.samples import DeviceSamples
from impid_host.study.folder import begin_study, write_trial
from impid_host.study.importing import read_mapped_log
from impid_host.study.mapping import Mapping, read_mapping
from impid_host.study.model import RobotLog, Session, Setup, Trial, TrialKind
from impid_host.study.notices import notices_as_lines
from impid_host.study.robot_csv import read_robot_log
from impid_host.study.setup_file import read_setup
from impid_host.study.trial_file import TrialHead, default_load


def _write_can_log(recording: Recording, path: Path) -> None:
    need("can", f"a {path.suffix} file")
    from impid_host.recording.export.can_log import write_can_log  # noqa: PLC0415  (an extra)

    write_can_log(recording, path)


_FILES = {".parquet": write_parquet, ".mat": write_mat, ".asc": _write_can_log, ".blf": _write_can_log}
_KINDS = ("free", "mass-spring", "arm", "stochastic")
_KIND_BY_NAME: dict[str, TrialKind] = {"free": "free", "spring": "mass-spring", "arm": "arm"}


@click.command()
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="FILE.mcap...")
@click.option(
    "--out",
    required=True,
    type=click.Path(path_type=Path),
    metavar="STUDY",
    help="Study folder; or a file ending in .parquet, .mat, .asc or .blf.",
)
@click.option(
    "--robot-log",
    "robot_logs",
    multiple=True,
    type=click.Path(path_type=Path),
    metavar="CSV",
    help="The robot's log of each recording, in the same order. Default: FILE.robot.csv.",
)
@click.option(
    "--mapping",
    "mapping_file",
    type=click.Path(path_type=Path),
    metavar="MAP.toml",
    help="How the robot's logs are written, as for `import`. Default: as robot.csv.",
)
@click.option(
    "--setup",
    "setup_file",
    type=click.Path(path_type=Path),
    metavar="TOML",
    help="The apparatus. Default: the study's own, else FILE.setup.toml, else the mapping's.",
)
@click.option(
    "--calibration",
    "calibration_file",
    type=click.Path(path_type=Path),
    metavar="FILE.json",
    help="Calibration of the accelerometer. Default: the recordings' own, where they carry one.",
)
@click.option(
    "--trial", metavar="NAME", help="Name of the trial (one FILE only). Default: FILE without .mcap."
)
@click.option(
    "--kind", type=click.Choice(_KINDS), help="Kind of trial. Default: by the name (free*, spring*, arm*)."
)
@click.option(
    "--on", type=click.Choice(("mass-spring", "arm")), help="For stochastic trials: what is shaken."
)
@click.option(
    "--load", metavar="NAME", help="Trials of one load share its name. Default: trial name without _NN."
)
@click.option(
    "--run", type=click.IntRange(min=0), help="Which run, where a recording holds several (from 0)."
)
def command(
    *,
    files: tuple[Path, ...],
    out: Path,
    robot_logs: tuple[Path, ...],
    mapping_file: Path | None,
    setup_file: Path | None,
    calibration_file: Path | None,
    trial: str | None,
    kind: TrialKind | None,
    on: Literal["mass-spring", "arm"] | None,
    load: str | None,
    run: int | None,
) -> None:
    """Write a study folder from a recording, or add a trial to one; or a file for other programs.

    Each recording becomes one trial folder with trial.toml, device.csv and robot.csv. Nothing that is there
    already is overwritten. The robot's own log, under its own column names, is read by a mapping as `import`
    takes it (docs/import.md). A calibration of the accelerometer that the recordings carry goes into the
    study's setup.toml.

    With --out FILE.parquet or FILE.mat the samples of one recording become a table, with --out FILE.asc or
    FILE.blf the raw frames of a CAN recording a log as CAN tools read it.

    \b
    Examples:
      impid-host export free_01.mcap spring_K1_M1_01.mcap --out study/
      impid-host export rec.mcap --robot-log rig.csv --setup rig.toml --trial arm_01 --kind arm --out study/
      impid-host export rec.mcap --robot-log rig.csv --mapping rig_map.toml --trial arm_01 --out study/
      impid-host export free_01.mcap --out free_01.parquet
    """
    if out.suffix.lower() in _FILES:
        _write_file(files, out)
        return
    if trial is not None and len(files) > 1:
        raise click.UsageError("--trial names one trial; give one FILE with it")
    if robot_logs and len(robot_logs) != len(files):
        raise click.UsageError(
            f"{len(files)} recordings need {len(files)} --robot-log, not {len(robot_logs)}"
        )
    if (kind == "stochastic") != (on is not None):
        raise click.UsageError("--kind stochastic and --on go together")
    logs = robot_logs or tuple(file.with_suffix(".robot.csv") for file in files)
    with notices_as_lines(lambda line: click.echo(line, err=True)):
        recordings = [_recording(file) for file in files]
        mapping = None if mapping_file is None else read_mapping(mapping_file)
        setup = _calibrated(_setup(out, setup_file, files[0], mapping), recordings, calibration_file)
        _refuse_other_apparatus(setup, out, setup_file)
        trials = []
        for recording, log in zip(recordings, logs, strict=True):
            name = trial or recording.path.stem
            robot, head = _robot_log(log, name, setup, mapping)
            trials.append(
                Trial(
                    name=name,
                    kind=kind or (head.kind if head else _kind_of(name, recording.path)),
                    load=load or (head.load if head else default_load(name)),
                    robot=robot,
                    device=_samples(recording, run),
                    on=on or (head.on if head and kind is None else None),
                    payload_kg=head.payload_kg if head else None,
                    note=head.note if head else "",
                    session=head.session if head else Session(),
                )
            )
        _refuse_existing(trials, out)
        if not (out / "setup.toml").exists():
            begin_study(setup, out)
        for each, recording in zip(trials, recordings, strict=True):
            place = write_trial(each, out)
            write_origin(recording, place)
            click.echo(
                f"{place}: {each.kind}, {len(each.device or ())} samples, {len(each.robot)} robot rows"
            )
        offer_check(out)


def _robot_log(
    log: Path, trial_name: str, setup: Setup, mapping: Mapping | None
) -> tuple[RobotLog, TrialHead | None]:
    """The robot's log, and what the mapping says of the trial, where there is one."""
    if mapping is None:
        return read_robot_log(log, setup.robot.model), None
    if mapping.setup.robot.model != setup.robot.model:
        what = f'is for robot.model = "{mapping.setup.robot.model}", the setup says "{setup.robot.model}"'
        raise InputError(mapping.path, what, "make the two agree")
    mapped = read_mapped_log(log, mapping, trial_name)
    return mapped.robot, mapped.head


def _calibrated(setup: Setup, recordings: list[Recording], calibration_file: Path | None) -> Setup:
    """The apparatus with the accelerometer's calibration, where there is one; says so."""
    if calibration_file is not None:
        now, words = apply(setup, read_calibration(calibration_file), calibration_file)
    else:
        now, words = with_calibration(setup, recordings)
    if words:
        click.echo(words)
    return now


def _write_file(files: tuple[Path, ...], out: Path) -> None:
    """One recording as one file; half a file is never left behind."""
    if len(files) != 1:
        raise click.UsageError(f"{out} takes one FILE; {len(files)} were given")
    if out.exists():
        raise InputError(out, "is there already", "choose another name, or move it away first")
    if not out.parent.is_dir():
        raise InputError(out, "its folder does not exist", f"make it first: mkdir -p {out.parent}")
    recording = read_recording(files[0])
    for warning in recording.warnings:
        click.echo(f"warning: {warning}", err=True)
    part = out.with_name(f".part-{out.name}")
    try:
        _FILES[out.suffix.lower()](recording, part)
        part.rename(out)
    except OSError as error:
        raise InputError(
            out, f"cannot be written ({error.strerror})", "free some space, or choose another place"
        ) from None
    finally:
        part.unlink(missing_ok=True)
    click.echo(f"{out}: {sum(map(len, recording.segments))} samples of {len(recording.segments)} run(s)")


def _setup(out: Path, setup_file: Path | None, first: Path, mapping: Mapping | None) -> Setup:
    """The apparatus: as given, or the study's own, or that beside the recording, or the mapping's."""
    own, beside = out / "setup.toml", first.with_suffix(".setup.toml")
    if setup_file is not None:
        return read_setup(setup_file)
    if own.exists():
        return read_setup(own)
    if mapping is not None and not beside.exists():
        return mapping.setup
    return read_setup(beside)


def _refuse_other_apparatus(setup: Setup, out: Path, setup_file: Path | None) -> None:
    """A study that exists must have been made with this apparatus, calibration and all."""
    own = out / "setup.toml"
    if own.exists() and read_setup(own) != setup:
        what = f"differs from {own}" if setup_file else "differs from it by the calibration to be applied"
        raise InputError(setup_file or own, what, "one study has one apparatus: export into another folder")


def _recording(file: Path) -> Recording:
    recording = read_recording(file)
    for warning in recording.warnings:
        click.echo(f"warning: {warning}", err=True)
    return recording


def _samples(recording: Recording, run: int | None) -> DeviceSamples:
    file, segments = recording.path, recording.segments
    if not segments:
        raise InputError(file, "holds no samples", "record again; `impid-host record` says what went wrong")
    if run is None and len(segments) > 1:
        lengths = ", ".join(f"{s.run} ({len(s)} samples, boot {s.boot_id})" for s in segments)
        raise InputError(file, f"holds {len(segments)} runs: {lengths}", "choose one with --run")
    chosen = [s for s in segments if s.run == (segments[0].run if run is None else run)]
    if not chosen:
        raise InputError(file, f"holds no run {run}", f"runs are 0 to {segments[-1].run}")
    return chosen[0].samples


def _kind_of(name: str, file: Path) -> TrialKind:
    start = re.match(r"[a-z]+", name.lower())
    kind = _KIND_BY_NAME.get(start[0] if start else "")
    if kind is None:
        raise InputError(file, f"the name {name} does not tell the kind of trial", "say it with --kind")
    return kind


def _refuse_existing(trials: list[Trial], out: Path) -> None:
    """Before anything is written: either all trials are added or none."""
    names = [trial.name for trial in trials]
    for trial in trials:
        if (out / trial.name).exists() or names.count(trial.name) > 1:
            raise InputError(
                out / trial.name,
                "is there already",
                "choose another name with --trial, or move it away first",
            )
