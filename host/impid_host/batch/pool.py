"""Where the work is done: in processes here, or on the workers of a Dask cluster."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from typing import Any

from impid_host import __version__
from impid_host.batch.task import Answer, BatchOptions
from impid_host.batch.worker import Child, in_this_thread
from impid_host.errors import ImpidError
from impid_host.extras import extra

_WAIT_S = 60


@dataclass(frozen=True, slots=True)
class Work:
    """What is to be done.

    Attributes:
        studies: their addresses; known: keys of results that are there.
        timeout_s: that one study may take.
    """

    studies: tuple[str, ...]
    options: BatchOptions
    known: frozenset[str]
    timeout_s: float


def local(work: Work, jobs: int) -> Iterator[Answer]:
    """Answers in the order in which they come, `jobs` processes at a time."""
    children = [Child() for _ in range(jobs)]
    free = list(children)

    def one(address: str) -> Answer:
        child = free.pop()
        try:
            return child.answer(address, work.options, work.known, work.timeout_s)
        finally:
            free.append(child)

    with ThreadPoolExecutor(jobs) as threads:
        asked = [threads.submit(one, address) for address in work.studies]
        try:
            for done in as_completed(asked):
                yield done.result()
        finally:
            for future in asked:
                future.cancel()
            for child in children:
                child.close()


def on_cluster(work: Work, scheduler: str) -> Iterator[Answer]:
    """The same from the workers of a scheduler, "tcp://host:8786" say.

    The client alone writes results: a worker that dies loses nothing that was handed in, and what it was
    working on is worked on again by another.

    Raises:
        MissingExtraError: `distributed` is not installed.
        ImpidError: no scheduler answers, it has no workers, they have another impid, or it went away.
    """
    distributed = extra("distributed", "--scheduler")
    try:
        client = distributed.Client(scheduler, timeout=_WAIT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ImpidError(
            f"{scheduler}: no Dask scheduler answers ({error}); start one with `dask scheduler`, "
            "and workers with `dask worker ADDRESS`"
        ) from None
    with client:
        _workers(client, scheduler)
        # A task and not scattered data: what a lost worker held is then made again.
        known = client.submit(frozenset, work.known)
        asked = {
            client.submit(in_this_thread, address, work.options, known, work.timeout_s, pure=False): address
            for address in work.studies
        }
        for future in distributed.as_completed(asked, loop=client.loop):
            yield _result(future, asked[future], scheduler)
            future.release()


def _workers(client: Any, scheduler: str) -> None:
    """See to it that there are workers, with this version of impid."""
    try:
        client.wait_for_workers(1, timeout=_WAIT_S)
        there = client.run(version_there)
    except TimeoutError:
        raise ImpidError(f"{scheduler}: has no worker; start some with: dask worker {scheduler}") from None
    except ModuleNotFoundError:
        there = {}
    other = [f"{address} has {version}" for address, version in there.items() if version != __version__]
    if other or not there:
        words = other[0] if other else "its workers have no impid"
        raise ImpidError(f"{scheduler}: {words}, this is {__version__}; install the same on every worker")


def version_there() -> str:
    """Of impid, where this runs."""
    return __version__


def _result(future: Any, address: str, scheduler: str) -> Answer:
    if future.status == "finished":
        answer: Answer = future.result()
        return answer
    if future.status == "error":
        why = f"its workers died one after the other ({type(future.exception()).__name__})"
        return Answer(address, "crashed", why=why, remedy=f"`impid-host fit {address}` shows more")
    raise ImpidError(
        f"{scheduler}: the scheduler is gone; what was finished is written, and the same command goes on"
    )


def answers(work: Work, *, jobs: int, scheduler: str | None) -> Iterator[Answer]:
    """From the cluster where one is named, else from processes here."""
    return local(work, jobs) if scheduler is None else on_cluster(work, scheduler)
