"""Writes docs/validation/recording.md from the figures that the other parts left behind."""

import json
from typing import Any

from common import RESULTS, ROOT


def _figures(part: str) -> dict[str, Any] | None:
    file = RESULTS / f"{part}.json"
    return json.loads(file.read_text(encoding="utf-8")) if file.exists() else None


def _kill(f: dict[str, Any]) -> list[str]:
    return [
        f"Killed at {f['times']} random moments, {f['opened']} files open. Missing at the end, on the board's clock "
        f"and with the {f['in_board_ms']} ms that the board still held: median {f['median_ms']:.0f} ms, 95 % below "
        f"{f['p95_ms']:.0f} ms, worst {f['worst_ms']} ms; {f['over_the_promise']} over 100 ms + {f['in_board_ms']} ms."
    ]


def _disk(f: dict[str, Any]) -> list[str]:
    return [
        f"Disk full at {f['times']} random sizes: {f['opened']} files open, {f['torn']} end in a torn record, "
        f"{f['wrong']} hold a wrong sample or ended without one clear line."
    ]


def _day(f: dict[str, Any]) -> list[str]:
    rows = [
        "| carrier | hours | produced | stored | lost | balanced | wrong samples | runs | took |",
        "| --- " * 9 + "|",
    ]
    for carrier in ("serial", "can"):
        r = f[carrier]
        rows.append(
            f"| {carrier} | {r['hours']:g} | {r['produced']} | {r['stored']} | {r['lost']} | "
            f"{'yes' if r['balanced'] else 'NO'} | {r['wrong']} | {r['runs']} | {r['took_s']} s |"
        )
    return [
        "Virtual time; the 32-bit sample index and the low half of the clock wrap half an hour in, frame numbers "
        "and the index bits of CAN all the time; every thousandth piece of the stream is taken away on the way.",
        "",
        *rows,
    ]


def _noise(f: dict[str, Any]) -> list[str]:
    d, p = f["decoder"], f["parser"]
    return [
        f"Decoder: {d['bytes']} bytes, {d['frames_damaged']} frames damaged (flipped bits, bytes put in, bytes taken "
        f"out, tails cut off and spliced), {d['frames_untouched']} not. Accepted {d['frames_accepted']} frames and "
        f"{d['samples_accepted']} samples, of which {d['wrong']} wrong; untouched frames refused: "
        f"{d['untouched_but_refused']}. Accepted beyond the untouched are those whose damage undid itself.",
        "",
        f"The board's parser: {p['bytes']} bytes with {p['intact_commands']} intact commands among damaged ones, "
        f"{p['answers']} answers, no crash, {p['bad_frames_of_the_board']} damaged frames from the board.",
    ]


def _load(f: dict[str, Any]) -> list[str]:
    rows = [
        "| carrier | s | produced | stored | lost | dropped by the board's line | balanced | file |",
        "| --- " * 8 + "|",
    ]
    for carrier in ("serial", "can"):
        r = f[carrier]
        rows.append(
            f"| {carrier} | {r['seconds']:g} | {r['produced']} | {r['stored']} | {r['lost']} | "
            f"{r['dropped_by_the_board']} frames | {'yes' if r['balanced'] else 'NO'} | {r['megabytes']} MB |"
        )
    return ["Real time, one process of pure computing beside it.", "", *rows]


def _can_loggers(f: dict[str, Any]) -> list[str]:
    rows = ["| recorder | opens | missing at the end, of |", "| --- " * 3 + "|"]
    rows += [
        f"| {name} | {r['opens']} | {r['missing_ms']} of {r['of_ms']} ms |"
        for name, r in f["loggers"].items()
    ]
    return [
        f"The same bus and board, kill -9, the worst of {f['times']}. python-can's text formats lose about as little "
        "as we do, because they hand every 8 kB to the system; its binary and SQLite formats collect far more first. "
        "None of them counts what was lost on the bus, tells a restart of the board, or keeps clock exchanges.",
        "",
        *rows,
        "",
        "Klipper records through its own host process and microcontroller, and LSL's LabRecorder is not on "
        "PyPI, so neither can be run on this link here. Their clock filters, as others describe them, are in "
        "the design's table: 65 µs with 290 µs of bias, and 56 µs; ours on the same model link is printed by "
        "`bench/clock_sync.py`.",
    ]


PARTS = (
    ("kill", "Killed", _kill),
    ("disk", "Full disk", _disk),
    ("day", "A day, with every counter's wrap", _day),
    ("noise", "Damaged bytes", _noise),
    ("load", "Load", _load),
    ("can_loggers", "Beside other recorders", _can_loggers),
)


def main() -> None:
    lines = [
        "# Recording: what was measured",
        "",
        "Written by `bench/recording/report.py` from the figures of the parts; `make validate` runs them all.",
        "",
    ]
    for part, title, text in PARTS:
        figures = _figures(part)
        lines += [f"## {title}", ""]
        lines += ["Not run yet."] if figures is None else [*text(figures), "", f"`{figures['command']}`"]
        if figures is not None and "machine" in figures:
            lines += ["", f"While it ran: {figures['machine']}."]
        lines.append("")
    target = ROOT / "docs" / "validation" / "recording.md"
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text("\n".join(lines), encoding="utf-8")


if __name__ == "__main__":
    main()
