"""The study folder: a whole campaign as plain files (docs/study-format.md)."""

import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from impid_host.errors import InputError
from impid_host.samples import DeviceSamples, ModuleSamples
from impid_host.signals.counts import encoder_counts
from impid_host.study.device_csv import read_device_samples, write_device_samples
from impid_host.study.joints import logged_joints
from impid_host.study.model import EncoderSetup, Setup, Study, Trial
from impid_host.study.narrow_counter import narrow_joints, widened
from impid_host.study.notices import notice
from impid_host.study.robot_csv import read_robot_log, write_robot_log
from impid_host.study.setup_file import read_setup, write_setup
from impid_host.study.trial_file import read_trial_head, write_trial_head

_TRIAL_FILES = ("trial.toml", "robot.csv", "device.csv")


def read_study(path: Path | str, also: Sequence[str] = ()) -> Study:
    """Read a study folder; `also` names other columns of robot.csv to be kept.

    Every subfolder that holds a `trial.toml`, `robot.csv` or `device.csv` is a trial; others (figures, say)
    are passed over. Oddities that were coped with are issued as `StudyWarning`.

    Raises:
        InputError: the folder, a file, a key or a cell is missing or wrong; names file, row and remedy.
    """
    folder = Path(path)
    if not folder.is_dir():
        what = "is not a folder" if folder.exists() else "does not exist"
        raise InputError(folder, what, "give the path of a study folder, which holds setup.toml")
    setup = read_setup(folder / "setup.toml")
    trials = tuple(read_trial(place, setup, also) for place in _trial_folders(folder))
    trials = _with_wide_counters(trials, setup.encoder, folder)
    if not trials:
        remedy = "put each trial into a subfolder with trial.toml and robot.csv"
        raise InputError(folder, "holds no trials", remedy)
    logged_joints(setup.robot, trials[0].robot.theta.shape[1], folder / "setup.toml")
    return Study(name=folder.resolve().name, setup=setup, trials=trials, source=folder)


def read_trial(path: Path | str, setup: Setup, also: Sequence[str] = ()) -> Trial:
    """Read one trial folder of a study with the apparatus `setup`; `also` as `read_study`, free trials apart.

    Raises:
        InputError: a file, a key or a cell is missing or wrong; names file, row and remedy.
    """
    folder = Path(path)
    head = read_trial_head(folder / "trial.toml")
    if not (folder / "robot.csv").is_file():
        raise InputError(
            folder, "holds no robot.csv", "add the robot's log, or remove the folder from the study"
        )
    robot = read_robot_log(folder / "robot.csv", setup.robot.model, () if head.kind == "free" else also)
    device = None
    if (folder / "device.csv").exists():
        device = _read_device(folder / "device.csv", setup)
    return Trial(
        name=folder.name,
        kind=head.kind,
        load=head.load,
        robot=robot,
        device=device,
        on=head.on,
        payload_kg=head.payload_kg,
        note=head.note,
        session=head.session,
    )


def _read_device(path: Path, setup: Setup) -> ModuleSamples:
    """The module's samples.

    Raises:
        InputError: they cannot be used, or setup.toml does not describe what they hold.
    """
    device = read_device_samples(path)
    counted = encoder_counts(device) is not None
    for table, needed, there in (
        ("[encoder]", counted, setup.encoder),
        ("[accelerometer]", True, setup.accelerometer),
    ):
        if needed and there is None:
            remedy = f"add {table} to setup.toml, or remove device.csv"
            raise InputError(path, f"is there, but setup.toml has no {table}", remedy)
    coded = isinstance(device, DeviceSamples) or device.codes is not None
    if coded and setup.accelerometer is not None and not setup.accelerometer.reads_codes:
        remedy = "add vref_V, full_scale_code, zero_g_V and sensitivity_V_per_g to its [accelerometer]"
        raise InputError(path, "has codes ax, ay, which setup.toml does not explain", remedy)
    return device


def _with_wide_counters(
    trials: tuple[Trial, ...], encoder: EncoderSetup | None, folder: Path
) -> tuple[Trial, ...]:
    """Where a counter of 16 bits wraps in one trial, it is as narrow in all of them."""
    devices = [trial.device for trial in trials if trial.device is not None]
    narrow = tuple(sorted({joint for device in devices for joint in narrow_joints(device)}))
    if encoder is None or not narrow:
        return trials
    names = " and ".join(f"enc{joint + 1}" for joint in narrow)
    notice(f"{folder}: {names} in device.csv wraps at 16 bits; the turns are put together again")
    return tuple(
        trial
        if trial.device is None
        else replace(
            trial,
            device=widened(trial.device, narrow, encoder, trial.robot.theta),
            narrow_counters=narrow,
        )
        for trial in trials
    )


def write_study(study: Study, path: Path | str) -> Path:
    """Write a whole study into a new folder (or an empty one) and return that folder.

    Reading it back gives the same study, floats to the last bit. Nothing that is there is ever overwritten.

    Raises:
        InputError: the folder holds something already, or cannot be written.
    """
    folder = Path(path)
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(folder, "is there already", "choose another name, or move it away first")
    begin_study(study.setup, folder)
    for trial in study.trials:
        write_trial(trial, folder)
    return folder


def begin_study(setup: Setup, path: Path | str) -> Path:
    """Make a study folder that holds the apparatus and, so far, no trial; `write_trial` adds them one by one.

    Raises:
        InputError: there is a setup.toml already, or the folder cannot be written.
    """
    folder = Path(path)
    if (folder / "setup.toml").exists():
        raise InputError(
            folder / "setup.toml", "is there already", "choose another folder, or move it away first"
        )
    try:
        folder.mkdir(parents=True, exist_ok=True)
        write_setup(setup, folder / "setup.toml")
    except OSError as error:
        raise InputError(
            folder, f"cannot be written ({error.strerror})", "check path, permissions and space"
        ) from None
    return folder


def write_trial(trial: Trial, study: Path | str) -> Path:
    """Add one trial to the study folder `study` and return the trial's folder.

    The files are written under a passing name first, so a trial folder is either complete or not there.

    Raises:
        InputError: a trial of that name is there already, the name is no folder name, or writing fails.
    """
    folder = Path(study)
    place, draft = folder / trial.name, folder / f".{trial.name}.part"
    if trial.name in ("", ".", "..") or Path(trial.name).name != trial.name:
        raise InputError(
            folder, f"{trial.name!r} cannot name a trial", "use a plain folder name such as free_01"
        )
    if place.exists():
        raise InputError(place, "is there already", "choose another trial name, or move it away first")
    try:
        shutil.rmtree(draft, ignore_errors=True)
        draft.mkdir(parents=True)
        write_trial_head(trial, draft / "trial.toml")
        write_robot_log(trial.robot, draft / "robot.csv")
        if trial.device is not None:
            write_device_samples(trial.device, draft / "device.csv")
        draft.rename(place)
    except OSError as error:
        raise InputError(
            place, f"cannot be written ({error.strerror})", "check path, permissions and space"
        ) from None
    return place


def _trial_folders(folder: Path) -> list[Path]:
    places = (place for place in folder.iterdir() if place.is_dir() and not place.name.startswith("."))
    return sorted(
        (place for place in places if any((place / name).exists() for name in _TRIAL_FILES)),
        key=lambda place: place.name,
    )
