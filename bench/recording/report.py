"""Writes docs/validation/recording.md from the figures that the other parts left behind."""

import json
from typing import Any

from common import RESULTS, ROOT


def _figures(part: str) -> dict[str, Any] | None:
    file = RESULTS / f"{part}.json"
    return json.loads(file.read_text(encoding="utf-8")) if file.exists() else None


def _faults(carriers: dict[str, dict[str, Any]]) -> list[str]:
    rows = [
        "| carrier | fault | produced | stored | lost | exact | resumed after | worst lag |",
        "| --- " * 8 + "|",
    ]
    passed = runs = 0
    for carrier, figures in carriers.items():
        for run in figures["runs"]:
            rest = {k: v for k, v in run["fault"].items() if k not in ("kind", "buffer_bytes")}
            what = ", ".join([run["fault"]["kind"], *(f"{k} {v}" for k, v in rest.items())])
            runs, passed = runs + 1, passed + run["balanced"]
            if "books" not in run:
                rows.append(f"| {carrier} | {what} | | | | NO: {run['failed']} | | |")
                continue
            books = run["books"]
            produced, stored, lost = (
                " + ".join(str(b[k]) for b in books) for k in ("produced", "stored", "lost")
            )
            bound = sum(b["uncounted"] for b in books)
            exact = (
                f"at most {bound} more" if bound and run["balanced"] else "yes" if run["balanced"] else "NO"
            )
            after = ", ".join(f"{ms:.0f} ms" for ms in run["resumed_ms"])
            rows.append(
                f"| {carrier} | {what} | {produced} | {stored} | {lost} | {exact} | {after} | {run['lag_s']} s |"
            )
    return [
        f"{passed} of {runs} runs balance. Produced is the simulator's own count of ticks while its board streamed, boot by "
        "boot; stored and lost are the recording's. After a reset the board's own count survives in its memory; after "
        "a loss of power the recording gives a bound from the clock. Resumed: board time from the end of the fault (after "
        "a reset: from the boot) to the first sample stored. Bits that flip on the line behind an SLCAN adapter are not "
        "in the table: its protocol has no checksum (docs/recording.md).",
        "",
        *rows,
    ]


def _kill(f: dict[str, Any]) -> list[str]:
    taken, missing = f["taken_ms"], f["missing_ms"]
    return [
        f"Killed at {f['times']} random moments, {f['opened']} files open. Of what the recorder had taken from the port, "
        f"missing in the file: median {taken['median']:.0f} ms, 95 % below {taken['p95']:.0f} ms, worst "
        f"{taken['worst']:.0f} ms; {f['taken_over_100_ms']} over 100 ms. With what was still on the board (a batch of ten "
        f"and two ticks of the filter) and in the port: median {missing['median']:.0f} ms, 95 % below "
        f"{missing['p95']:.0f} ms, worst {missing['worst']:.0f} ms; {f['over_100_ms']} over 100 ms. The file is flushed "
        "every 20 ms.",
    ]


def _kill_stalled(f: dict[str, Any]) -> list[str]:
    return [
        "The recorder held up for half a second first, as a busy machine does, and killed within 40 ms of its going on, "
        "while it catches up.",
        "",
        *_kill(f),
    ]


def _disk(f: dict[str, Any]) -> list[str]:
    return [
        f"Disk full at {f['times']} random sizes: {f['opened']} files open, {f['torn']} end in a torn record, "
        f"{f['wrong']} hold a wrong sample, {f['unclear']} ended without one clear last line. Samples that had arrived "
        f"and are missing: median {f['missing_ms']['median']:.0f} ms, worst {f['missing_ms']['worst']} ms; "
        f"{f['over_100_ms']} over 100 ms."
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


def _day_file(carriers: dict[str, dict[str, Any]]) -> list[str]:
    rows = [
        "| carrier | hours | produced | stored | lost | balanced | wrong samples | file | written, read in (CPU) |"
    ]
    rows.append("| --- " * 9 + "|")
    rows += [
        f"| {carrier} | {r['hours']:g} | {r['produced']} | {r['stored']} | {r['lost']} | "
        f"{'yes' if r['balanced'] and r['as_live'] else 'NO'} | {r['wrong']} | {r['gigabytes']} GB | "
        f"{r['wrote_cpu_s']:.0f} s, {r['read_cpu_s']:.0f} s |"
        for carrier, r in carriers.items()
    ]
    return [
        "Board, decoder, recording file, reader; virtual time, flushed every 20 ms of it, the same wraps inside, every "
        "thousandth piece taken away.",
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
        f"The board's command parser: {p['bytes']} bytes with {p['intact_commands']} intact commands among three times as "
        f"many damaged, no crash; {p['unanswered']} intact commands unanswered, {p['foreign_answers']} answers that "
        f"nobody asked for, {p['of_damage_undone']} answers to commands whose damage undid itself (only a delimiter, "
        f"which the next command brings again), {p['bad_frames_of_the_board']} damaged frames from the board.",
    ]


def _load(carriers: dict[str, dict[str, Any]]) -> list[str]:
    rows = [
        "| carrier | s | produced | stored | lost | balanced | file | the machine meanwhile |",
        "| --- " * 8 + "|",
    ]
    rows += [
        f"| {carrier} | {r['seconds']:g} | {r['produced']} | {r['stored']} | "
        f"{sum(r[k] or 0 for k in ('lost_before', 'lost_inside', 'lost_after'))} | "
        f"{'yes' if r['balanced'] else 'NO'} | {r['megabytes']} MB | {r['machine']} |"
        for carrier, r in carriers.items()
    ]
    return [
        "Real time, a process of pure computing beside it; recorder and board at priority -5, as the board's timer would "
        "have it.",
        "",
        *rows,
    ]


def _stamps(f: dict[str, Any]) -> list[str]:
    def table(recorders: dict[str, dict[str, float]]) -> list[str]:
        rows = [
            "| recorder | mean error | rms about it | worst | missing after kill -9 |",
            "| --- " * 5 + "|",
        ]
        for name, r in recorders.items():
            killed = f"{r['missing_after_kill_ms']} ms" if "missing_after_kill_ms" in r else ""
            rows.append(
                f"| {name} | {r['mean_us']:.1f} us | {r['rms_about_mean_us']:.1f} us | {r['worst_us']:.0f} us | {killed} |"
            )
        return rows

    bound = f["recorders"]["impid-host, offline"]["hard_bound_us"]
    return [
        "Error of the board's clock on the design's model link (10 Hz, 150 us + exponential 300 us each way, 5 % outliers):",
        "",
        *table(f["model"]),
        "",
        f"Error of the time stamps on a live link of {f['seconds']:g} s whose board's clock is the PC's own. The mean error "
        "of impid-host is the asymmetry of the link, which no exchange sees; it says so itself with a hard bound of "
        f"{bound:.0f} us. LSL and python-can stamp what arrives; LSL's inlet writes lines, as its example does, for its "
        "recorder is not on PyPI. Klipper's filter is written anew from its description, on our raw exchanges; the design notes' figure for "
        "it is 65 us plus 290 us of bias. What is late on a machine this busy is late in everybody's stamps but those that "
        "come from the board's own clock.",
        "",
        *table(f["recorders"]),
    ]


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
    ]


PARTS = (
    ("faults", "Faults of line, bus and board", _faults, ("pty", "tcp", "slcan", "udp_multicast")),
    ("kill", "Killed", _kill, ()),
    ("kill_stalled", "Killed behind a stall", _kill_stalled, ()),
    ("disk", "Full disk", _disk, ()),
    ("day", "A day, with every counter's wrap", _day, ()),
    ("day_file", "Through the file", _day_file, ("serial", "can")),
    ("noise", "Damaged bytes", _noise, ()),
    ("load", "Load", _load, ("serial", "slcan", "udp_multicast")),
    ("stamps", "Time stamps, beside Klipper, LSL and python-can", _stamps, ()),
    ("can_loggers", "What a kill costs, beside python-can's loggers", _can_loggers, ()),
)


def _section(part: str, text: Any, variants: tuple[str, ...]) -> list[str]:
    if not variants:
        figures = _figures(part)
        if figures is None:
            return ["Not run yet."]
        return [
            *text(figures),
            "",
            f"`{figures['command']}`"
            + (f"; while it ran, {figures['machine']}" if "machine" in figures else ""),
        ]
    found = {name: figures for name in variants if (figures := _figures(f"{part}_{name}")) is not None}
    if not found:
        return ["Not run yet."]
    missing = [name for name in variants if name not in found]
    rest = ["", f"Not run yet: {', '.join(missing)}."] if missing else []
    return [*text(found), *rest, "", ", ".join(f"`{figures['command']}`" for figures in found.values())]


def main() -> None:
    lines = [
        "# Recording: what was measured",
        "",
        "Written by `bench/recording/report.py` from the figures of the parts; `make validate` runs them all.",
        "",
    ]
    for part, title, text, variants in PARTS:
        lines += [f"## {title}", "", *_section(part, text, variants), ""]
    target = ROOT / "docs" / "validation" / "recording.md"
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text("\n".join(lines), encoding="utf-8")


if __name__ == "__main__":
    main()
