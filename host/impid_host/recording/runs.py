"""What is known of a run without keeping its samples."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Self

import numpy as np

from impid_host.wire.messages import SAMPLE_PERIOD_US
from impid_host.wire.records import Segment, until

_FLAG_BITS = 8


@dataclass(slots=True)
class Run:
    """One run of one boot.

    Attributes:
        boot_id, run: which.
        first_index, first_us: index (64 bit) and stamp of its first sample.
        last_index, last_us: those of the last that arrived.
        arrived: samples that arrived.
        stored: of these, the ones up to the duration asked for.
        stored_until_us: stamp of the last of them.
        flags: stored samples with each of the eight flag bits.
    """

    boot_id: int
    run: int
    first_index: int
    first_us: int
    last_index: int
    last_us: int
    arrived: int = 0
    stored: int = 0
    stored_until_us: int = 0
    flags: list[int] = field(default_factory=lambda: [0] * _FLAG_BITS)

    @property
    def duration_s(self) -> float:
        """Board time from first to last stored sample, lost ones included."""
        return (self.stored_until_us - self.first_us + SAMPLE_PERIOD_US) * 1e-6 if self.stored else 0.0

    def flagged(self, flag: int) -> int:
        """How many stored samples carry a flag of one bit."""
        return self.flags[flag.bit_length() - 1]

    @classmethod
    def of(cls, segment: Segment) -> Self:
        """A run all of whose samples are stored."""
        runs: dict[int, Self] = {}
        cls.see(runs, segment, None)
        return runs[segment.run]

    @classmethod
    def see(cls, runs: "dict[int, Self]", segment: Segment, end: tuple[int, int] | None) -> Segment | None:
        """Add a piece of a run; returns what of it is stored, up to the run and stamp of `end`."""
        t_us = segment.samples.t_us
        run = runs.get(segment.run)
        if run is None:
            first = int(segment.index[0]), int(t_us[0])
            run = runs[segment.run] = cls(segment.boot_id, segment.run, *first, *first)
        run.last_index, run.last_us = int(segment.index[-1]), int(t_us[-1])
        run.arrived += len(segment)
        kept = until(segment, end)
        if kept is not None:
            run.stored += len(kept)
            run.stored_until_us = int(kept.samples.t_us[-1])
            counts = np.bincount(kept.samples.flags, minlength=1 << _FLAG_BITS)
            for bit in range(_FLAG_BITS):
                run.flags[bit] += int(counts.reshape(-1, 2, 1 << bit)[:, 1].sum())
        return kept


def duration_s(runs: Iterable[Run]) -> float:
    """Board time of all runs."""
    return sum(run.duration_s for run in runs)
