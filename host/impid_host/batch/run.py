"""The whole batch: find the studies, work on what is not done, write each result as it comes."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from impid_host.batch.data_set import DataSet
from impid_host.batch.places import place
from impid_host.batch.pool import Work, answers
from impid_host.batch.task import BROKEN, Answer, BatchOptions
from impid_host.errors import InputError
from impid_host.extras import need

# done, of how many, how many of them broken
Progress = Callable[[int, int, int], None]


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of the studies.

    Attributes:
        counts: studies by status.
        broken: what cannot be used or did not end; undetermined: what the data do not determine.
        impossible: studies about which something is impossible.
        superseded: older results that were removed.
    """

    counts: dict[str, int]
    broken: tuple[Answer, ...]
    undetermined: tuple[Answer, ...]
    impossible: tuple[Answer, ...]
    superseded: int


def run(
    studies: Sequence[str],
    out: str,
    options: BatchOptions,
    *,
    jobs: int,
    scheduler: str | None,
    timeout_s: float,
    command: str,
    progress: Progress,
) -> Outcome:
    """Work on all studies at or below the given places; results to the folder `out`.

    Raises:
        ImpidError: the results' folder or the scheduler cannot be used; nothing about a single study.
    """
    if scheduler is not None:
        need("distributed", "--scheduler")
    results = DataSet(place(out))
    found, came = find(studies)
    work = Work(tuple(found), options, results.known, timeout_s)
    total = len(found) + len(came)
    told: list[Answer] = []
    counts: Counter[str] = Counter()

    def take(answer: Answer) -> None:
        results.add(answer, options, command)
        told.append(replace(answer, rows=()))
        counts[answer.status] += 1
        progress(len(told), total, sum(counts[status] for status in BROKEN))

    for answer in came:
        take(answer)
    for answer in answers(work, jobs=jobs, scheduler=scheduler):
        take(answer)
    return Outcome(
        counts=dict(counts),
        broken=tuple(own for own in told if own.status in BROKEN),
        undetermined=tuple(own for own in told if own.status == "undetermined"),
        impossible=tuple(own for own in told if own.impossible),
        superseded=results.drop_superseded(),
    )


def find(places: Sequence[str]) -> tuple[list[str], list[Answer]]:
    """The studies at or below the places, each once; and an answer for each place that holds none."""
    found: dict[str, None] = {}
    nothing = []
    for address in places:
        try:
            found.update(dict.fromkeys(place(address).studies()))
        except InputError as error:
            nothing.append(
                Answer(address, "unreadable", why=f"{error.where}: {error.what}", remedy=error.remedy)
            )
    return list(found), nothing
