"""What `impid-host judge` prints and writes, format impid-judge/1; keys once used keep their meaning."""

from typing import Any

from rich.table import Column, Table

from impid_host.checks import Checks
from impid_host.diagnosis.other_records import Band, ChannelErrors, Error, Judgement

Json = dict[str, Any]


def judgement_json(judgement: Judgement, checks: Checks) -> Json:
    """The whole answer; errors in N m (N on forces and on sliding joints) and in % of the logged signal."""
    return {
        "format": "impid-judge/1",
        "model": judgement.model,
        "fitted_on": [judgement.fitted_on],
        "studies": list(judgement.studies),
        "bands": [
            {
                "cutoff_hz": band.cutoff_hz,
                "channels": {key: _channel(own) for key, own in band.channels.items()},
            }
            for band in judgement.bands
        ],
        "skipped_hz": list(judgement.skipped_hz),
        "left_out": list(judgement.left_out),
        "refitted": list(judgement.refitted),
        "notes": list(judgement.notes),
        "same_data": list(judgement.same_data),
        **checks.to_dict(),
    }


def _channel(errors: ChannelErrors) -> Json:
    return {
        "textbook": None if errors.textbook is None else _error(errors.textbook),
        "stages": [{"added": stage.added, **_error(stage.error)} for stage in errors.stages],
    }


def _error(error: Error) -> Json:
    return {"rms": error.rms, "relative_percent": error.relative_percent}


def band_table(band: Band, judgement: Judgement) -> Table:
    """One band: a row for the textbook's model and each stage, a column for each channel."""
    keys = list(band.channels)
    torque = "N" if judgement.prismatic else "N m"
    heads = [Column(f"{key} ({torque if key.startswith('tau') else 'N'})", justify="right") for key in keys]
    title = f"below {band.cutoff_hz:g} Hz: rms, and % of the logged signal"
    table = Table(Column("model", no_wrap=True), *heads, title=title, title_justify="left")
    channels = [band.channels[key] for key in keys]
    if all(own.textbook is not None for own in channels):
        cells = [_cell(own.textbook) for own in channels if own.textbook is not None]
        table.add_row("textbook", *cells, end_section=True)
    for number, stage in enumerate(channels[0].stages):
        name = "first model" if stage.added is None else f"+ {stage.added}"
        table.add_row(name, *(_cell(own.stages[number].error) for own in channels))
    return table


def _cell(error: Error) -> str:
    share = error.relative_percent
    return f"{error.rms:.3g}" + ("" if share is None else f"\n{share:.2f} %")


def lines(judgement: Judgement) -> list[str]:
    """What a reader must know beside the numbers."""
    told = [
        f"Nothing was fitted on {', '.join(judgement.studies)}" + ("." if not judgement.refitted else " but:")
    ]
    told += [f"  fitted anew: {line}" for line in judgement.refitted]
    told += [f"Left out, {line}." for line in judgement.left_out]
    told += [f"Not judged: {line}." for line in judgement.notes]
    if judgement.skipped_hz:
        slow = ", ".join(f"{cutoff:g}" for cutoff in judgement.skipped_hz)
        told.append(f"Not judged at {slow} Hz: the logs are too slow.")
    return told


def warnings(judgement: Judgement) -> list[str]:
    """What takes the judgement its worth."""
    if not judgement.same_data:
        return []
    files = ", ".join(judgement.same_data[:3]) + (", ..." if len(judgement.same_data) > 3 else "")
    return [
        f"{judgement.model} was found on these very data ({files}): errors on them say nothing of new data"
    ]
