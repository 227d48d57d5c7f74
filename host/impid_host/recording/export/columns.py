"""The samples of a recording as columns: one row a sample, all runs one after the other."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from impid_host.errors import InputError
from impid_host.recording.reader import Recording
from impid_host.wire.records import Segment

Columns = dict[str, NDArray[np.generic]]


def sample_columns(recording: Recording) -> Columns:
    """Columns boot_id, run, index, t_us, ax, ay (az where there is one), enc1, enc2, flags, each (N,).

    Rows of different runs share no clock: t_us begins anew with each boot.

    Raises:
        InputError: the recording holds no samples.
    """
    if not recording.segments:
        raise InputError(
            recording.path, "holds no samples", "record again; `impid-host info` says what went wrong"
        )
    return columns_of(recording.segments)


def columns_of(segments: Sequence[Segment]) -> Columns:
    """The same of at least one segment."""
    columns: Columns = {
        "boot_id": np.concatenate([np.full(len(s), s.boot_id, dtype=np.uint16) for s in segments]),
        "run": np.concatenate([np.full(len(s), s.run, dtype=np.uint16) for s in segments]),
        "index": np.concatenate([s.index for s in segments]),
    }
    third = ("az",) if all(s.samples.az is not None for s in segments) else ()
    for name in ("t_us", "ax", "ay", *third, "enc1", "enc2", "flags"):
        columns[name] = np.concatenate([getattr(s.samples, name) for s in segments])
    return columns


def flat_metadata(metadata: Mapping[str, Mapping[str, str]]) -> dict[str, str]:
    """Everything a recording says of itself, as name.key -> value."""
    return {f"{name}.{key}": value for name, values in metadata.items() for key, value in values.items()}
