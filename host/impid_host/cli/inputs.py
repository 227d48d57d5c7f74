"""What `sync` and `fit` work on: a study folder, or recordings with their robot logs, as one Study."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from impid_host.errors import InputError
from impid_host.study.folder import read_study
from impid_host.study.joints import logged_joints
from impid_host.study.model import Setup, Study, Trial, TrialKind
from impid_host.study.names import distinct_names
from impid_host.study.notices import notices_as_lines
from impid_host.study.robot_csv import read_robot_log
from impid_host.study.setup_file import read_setup

if TYPE_CHECKING:
    from impid_host.recording.reader import Recording

_KIND_OF_NAME: tuple[tuple[str, TrialKind], ...] = (
    ("free", "free"),
    ("spring", "mass-spring"),
    ("mass", "mass-spring"),
    ("load", "mass-spring"),
    ("arm", "arm"),
)


def load_inputs(paths: Sequence[Path], robot_logs: Sequence[Path], setup: Path | None) -> Study:
    """A study folder as it is, or recordings, one robot log each, with the apparatus of `setup`.

    Raises:
        InputError: a path that is neither, a recording without its log, or a file that cannot be used.
    """
    with notices_as_lines(lambda line: click.echo(line, err=True)):
        if paths[0].is_dir() or paths[0].suffix.lower() != ".mcap":
            if len(paths) > 1:
                raise InputError(
                    paths[1], "is one path too many", "give one study folder, or recordings (.mcap)"
                )
            return read_study(paths[0])
        if setup is None:
            raise InputError(paths[0], "is a recording and needs its apparatus", "add --setup setup.toml")
        if len(robot_logs) != len(paths):
            what = f"{len(paths)} recording(s) but {len(robot_logs)} robot log(s)"
            raise InputError(paths[0], what, "give one --robot-log for each recording, in the same order")
        from impid_host.calibration.applied import with_calibration  # noqa: PLC0415  (of recordings alone)

        recordings = [_recording(path) for path in paths]
        apparatus, words = with_calibration(read_setup(setup), recordings)
        if words:
            click.echo(words, err=True)
        trials = [
            _trial(recording, log, apparatus) for recording, log in zip(recordings, robot_logs, strict=True)
        ]
        logged_joints(apparatus.robot, trials[0].robot.theta.shape[1], setup)
    return Study(paths[0].stem, apparatus, tuple(sorted(trials, key=lambda trial: trial.name)), source=None)


def load_studies(paths: Sequence[Path]) -> list[Study]:
    """Several study folders; where two have one name, parents' names are put before it.

    Raises:
        InputError: as `load_inputs`, or the same folder twice.
    """
    places = [path.resolve() for path in paths]
    for path, place in zip(paths, places, strict=True):
        if places.count(place) > 1:
            raise InputError(path, "is given twice", "give each study once")
    read = [load_inputs([path], (), None) for path in paths]
    names = distinct_names({str(place): study.name for study, place in zip(read, places, strict=True)})
    return [replace(study, name=names[str(place)]) for study, place in zip(read, places, strict=True)]


def _recording(path: Path) -> "Recording":
    from impid_host.recording.reader import read_recording  # noqa: PLC0415  (the wire formats are slow to load)

    recording = read_recording(path)
    for warning in recording.warnings:
        click.echo(f"{path}: {warning}", err=True)
    return recording


def _trial(recording: "Recording", log: Path, setup: Setup) -> Trial:
    path = recording.path
    if not recording.segments:
        raise InputError(path, "holds no samples", "record again with the board streaming")
    longest = max(recording.segments, key=lambda segment: len(segment.samples))
    if len(recording.segments) > 1:
        click.echo(
            f"{path}: {len(recording.segments)} runs (board reset or reconnect); the longest is used",
            err=True,
        )
    kind = next((kind for start, kind in _KIND_OF_NAME if path.stem.lower().startswith(start)), None)
    if kind is None:
        remedy = "name it free..., spring... or arm..., or make a study folder with `impid-host export`"
        raise InputError(path, "does not say what trial it is", remedy)
    return Trial(
        name=path.stem,
        kind=kind,
        load=re.sub(r"_\d+$", "", path.stem),
        robot=read_robot_log(log, setup.robot.model),
        device=longest.samples,
    )
