"""What a recording is, in lines: what, when, how much, losses, clocks, health of the board."""

from collections.abc import Iterator
from datetime import UTC, datetime
from typing import Any

from impid_host.clock.device import fit_clock
from impid_host.errors import UndeterminedError
from impid_host.recording import channels
from impid_host.recording.reader import Recording
from impid_host.recording.runs import Run
from impid_host.samples import (
    FLAG_ENCODER_FAULT,
    FLAG_LATE,
    FLAG_SATURATED,
    FLAG_SYNC_EDGE,
)
from impid_host.wire.messages import choices
from impid_host.wire.records import BoardStatus

_FLAGS = {
    "saturated": FLAG_SATURATED,
    "encoder faults": FLAG_ENCODER_FAULT,
    "late": FLAG_LATE,
    "sync edges": FLAG_SYNC_EDGE,
}
_SELF_TEST = {number: name for name, number in choices("STATUS_HEALTH", "self_test").items()}
_RESET = {number: name for name, number in choices("STATUS_HEALTH", "reset_cause").items()}


def overview(recording: Recording) -> dict[str, Any]:
    """Everything that `info` tells, for JSON; times in seconds, the clock in microseconds and ppm."""
    host = recording.metadata.get(channels.METADATA_HOST, {})
    starts = [event.wall_ns for event in recording.events if event.name == "start"]
    summary = recording.metadata.get(channels.METADATA_SUMMARY, {})
    return {
        "file": str(recording.path),
        "carrier": recording.carrier,
        "recorded_at": None if not starts else _moment(starts[0]),
        "ending": summary.get("ending", "cut off"),
        "duration_s": round(recording.duration_s, 6),
        "host": host,
        "board": recording.metadata.get(channels.METADATA_BOARD, {}),
        "settings": recording.metadata.get(channels.METADATA_SETTINGS, {}),
        "calibration": recording.metadata.get(channels.METADATA_CALIBRATION, {}),
        "runs": [_run(recording, run) for run in recording.runs],
        "events": [
            {"event": event.name, "at": _moment(event.wall_ns), **event.detail}
            for event in recording.events
            if event.name not in ("start", "run", "stop", "loss")
        ],
        "damaged_frames": recording.counts.bad_frames,
        "lost_frames": recording.counts.lost_frames,
        "health": None if not recording.statuses else _health(recording.statuses[-1]),
        "warnings": list(recording.warnings),
    }


def lines(recording: Recording) -> Iterator[str]:
    """The same for reading."""
    told = overview(recording)
    board = told["board"]
    yield f"{told['file']}: {told['duration_s']:.3f} s over {told['carrier']}, {told['ending']}"
    if told["recorded_at"] is not None:
        yield f"  recorded {told['recorded_at']} by impid-host {told['host'].get('version', '?')}"
    if board:
        uid = "-".join(f"{int(board.get(f'uid_{n}', 0)):08x}" for n in range(3))
        yield f"  board {uid}, firmware {board.get('firmware', board.get('firmware_version', '?'))}"
    for run in told["runs"]:
        yield f"  run {run['run']} (boot {run['boot_id']}): {run['books']}"
        flags = ", ".join(f"{count} {name}" for name, count in run["flags"].items() if count)
        yield f"    {run['duration_s']:.3f} s, {flags or 'no flags'}; {run['clock']}"
    for event in told["events"]:
        rest = ", ".join(f"{key} {value}" for key, value in event.items() if key not in ("event", "at"))
        yield f"  {event['at']} {event['event']}" + (f" ({rest})" if rest else "")
    yield f"  line: {told['damaged_frames']} damaged frames, {told['lost_frames']} frames lost"
    if told["health"] is not None:
        yield "  health: " + ", ".join(f"{name} {value}" for name, value in told["health"].items())
    if told["settings"]:
        yield "  settings: " + ", ".join(f"{name} {value}" for name, value in told["settings"].items())
    if told["calibration"]:
        yield "  calibration: " + ", ".join(f"{name} {value}" for name, value in told["calibration"].items())
    for warning in told["warnings"]:
        yield f"  warning: {warning}"


def _run(recording: Recording, run: Run) -> dict[str, Any]:
    ledger = next(each for each in recording.ledgers if each.run == run.run)
    return {
        "run": run.run,
        "boot_id": run.boot_id,
        "duration_s": run.duration_s,
        "stored": ledger.stored,
        "lost": ledger.lost,
        "surplus": ledger.surplus,
        "produced": ledger.produced,
        "balanced": ledger.balanced,
        "books": str(ledger),
        "flags": {name: run.flagged(flag) for name, flag in _FLAGS.items()},
        "clock": _clock(recording, run.boot_id),
    }


def _clock(recording: Recording, boot_id: int) -> str:
    exchanges = recording.exchanges.get(boot_id, [])
    try:
        return str(fit_clock(exchanges, nominal_rate=recording.nominal_rate))
    except UndeterminedError as error:
        return f"clock not determined: {error}"


def _health(status: BoardStatus) -> dict[str, Any]:
    return {
        "uptime_s": status.uptime_s,
        "last_reset": _RESET.get(status.reset_cause, str(status.reset_cause)),
        "self_test": _SELF_TEST.get(status.self_test, str(status.self_test)),
        "supply_mV": status.supply_mV,
        "worst_tick_us": status.worst_tick_us,
        "late": status.late,
        "overruns": status.overruns,
        "saturated": status.saturated,
        "encoder_faults": status.encoder_faults,
        "frames_dropped": status.frames_dropped,
        "rejected_commands": status.rejected,
        "bus_off": status.bus_off,
        "line_errors": status.line_errors,
        "can_overruns": status.can_overruns,
        "adc_overruns": status.adc_overruns,
        "dma_errors": status.dma_errors,
    }


def _moment(wall_ns: int) -> str:
    return datetime.fromtimestamp(wall_ns * 1e-9, UTC).astimezone().isoformat(timespec="milliseconds")
