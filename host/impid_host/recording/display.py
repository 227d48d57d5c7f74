"""Shows a recording as it grows: a bar on a terminal, plain lines anywhere else."""

import time
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager

import rich.progress
from rich.console import Console

from impid_host.recording.recorder import Progress

_PLAIN_EVERY_S = 10.0


@contextmanager
def progress_display(console: Console, name: str, duration_s: float | None) -> "Iterator[_Display]":
    """Something to call with each `Progress`; ends the bar when left."""
    if not console.is_terminal:
        yield _Lines(console, name, duration_s)
        return
    columns = (
        rich.progress.TextColumn("{task.description}"),
        rich.progress.BarColumn(bar_width=20),
        rich.progress.TextColumn("{task.fields[state]}"),
    )
    with rich.progress.Progress(*columns, console=console) as bar:
        yield _Bar(bar, bar.add_task(name, total=duration_s, state="waiting for samples"))


class _Display(ABC):
    """Shows progress."""

    def __init__(self) -> None:
        self._rate = _Rate()

    def __call__(self, progress: Progress) -> None:
        self._show(progress, self._rate.of(progress.counts.stored))

    @abstractmethod
    def _show(self, progress: Progress, rate_hz: float) -> None: ...


class _Bar(_Display):
    def __init__(self, bar: rich.progress.Progress, task: rich.progress.TaskID) -> None:
        super().__init__()
        self._bar = bar
        self._task = task

    def _show(self, progress: Progress, rate_hz: float) -> None:
        self._bar.update(self._task, completed=progress.elapsed_s, state=_state(progress, rate_hz))


class _Lines(_Display):
    def __init__(self, console: Console, name: str, duration_s: float | None) -> None:
        super().__init__()
        self._console = console
        self._name = name
        self._of = "" if duration_s is None else f" of {duration_s:g} s"
        self._due_s = time.monotonic() + _PLAIN_EVERY_S

    def _show(self, progress: Progress, rate_hz: float) -> None:
        if time.monotonic() >= self._due_s:
            self._console.print(f"{self._name}{self._of}: {_state(progress, rate_hz)}", soft_wrap=True)
            self._due_s += _PLAIN_EVERY_S


class _Rate:
    """Samples a second, over the last second or so."""

    def __init__(self) -> None:
        self._since_s, self._since_count, self._hz = time.monotonic(), 0, 0.0

    def of(self, count: int) -> float:
        elapsed = time.monotonic() - self._since_s
        if elapsed >= 1.0 or self._hz == 0.0:
            self._hz = (count - self._since_count) / max(elapsed, 1e-3)
            self._since_s, self._since_count = time.monotonic(), count
        return self._hz


def _state(progress: Progress, rate_hz: float) -> str:
    counts = progress.counts
    if not progress.connected:
        return f"{progress.elapsed_s:.1f} s  the board is gone, waiting for it"
    damaged = f", {counts.bad_frames} damaged frames" if counts.bad_frames else ""
    clock = "?" if progress.clock is None else f"±{progress.clock.offset_interval_us:.0f} us"
    return f"{progress.elapsed_s:.1f} s  {rate_hz:.0f}/s  {counts.lost} lost{damaged}  clock {clock}"
