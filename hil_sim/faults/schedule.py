"""When each fault begins and ends, and the book of what happened."""

from dataclasses import dataclass
from typing import Any, Literal

from hil_sim.faults import schema
from hil_sim.faults.injectors import Injector, Rig, injector
from hil_sim.seeds import generator

Json = dict[str, Any]
Phase = Literal["begin", "end"]


@dataclass(frozen=True)
class Transition:
    """A fault begins or ends, `since_us` after the motion began."""

    since_us: int
    phase: Phase
    index: int


class Schedule:
    """The faults of one trial. Its owner asks when the next transition is due, and carries it out then."""

    def __init__(self, faults: tuple[schema.Fault, ...], trial: str, seed: int, rig: Rig) -> None:
        """Makes ready.

        Raises:
            SimError: the rig has nothing on which one of the faults could act.
        """
        self._faults = [fault for fault in faults if fault.trials is None or trial in fault.trials]
        self._injectors: list[Injector] = [
            injector(fault, rig, generator(seed, trial, f"fault {i} {fault.kind}"))
            for i, fault in enumerate(self._faults)
        ]
        self.records: list[Json] = [
            fault.model_dump(exclude={"trials"}) | {"begin": None, "end": None, "counts": {}}
            for fault in self._faults
        ]
        ordered = [
            Transition(since_us, phase, index)
            for index, fault in enumerate(self._faults)
            for phase, since_us in _phases(fault)
        ]
        # What ends comes before what begins at the same moment.
        self._waiting = sorted(ordered, key=lambda t: (t.since_us, t.phase == "begin", t.index))
        self._active: set[int] = set()

    @property
    def next_since_us(self) -> int | None:
        """When the next transition is due, since the motion began; None: there is none."""
        return self._waiting[0].since_us if self._waiting else None

    @property
    def cable_is_out(self) -> bool:
        """The cable is pulled and will be put back."""
        return any(self._faults[index].kind == "cable_pulled" for index in self._active)

    def step(self, board_us: int | None, boot_id: int) -> Json:
        """Carries the next transition out.

        Args:
            board_us: what the board's clock shows; None while the board is off.
            boot_id: of the board at this moment.

        Returns:
            The event, to be made known.
        """
        transition = self._waiting.pop(0)
        index, record = transition.index, self.records[transition.index]
        if transition.phase == "begin":
            self._injectors[index].begin()
            self._active.add(index)
        else:
            self._injectors[index].end()
        if transition.phase == "end" or self._faults[index].begin_us == self._faults[index].end_us:
            self._active.discard(index)
        record[transition.phase] = {"board_us": board_us, "boot_id": boot_id}
        record["counts"] = self._injectors[index].counts()
        return {
            "event": "fault",
            "fault": index,
            "kind": record["kind"],
            "phase": transition.phase,
            "at_s": 1e-6 * transition.since_us,
            "board_us": board_us,
            "boot_id": boot_id,
            "counts": record["counts"],
        }

    def close(self) -> list[Json]:
        """The final book; faults that had no time to end have counts, but no end."""
        for index in self._active:
            self.records[index]["counts"] = self._injectors[index].counts()
        return self.records


def _phases(fault: schema.Fault) -> list[tuple[Phase, int]]:
    if fault.end_us == fault.begin_us:
        return [("begin", fault.begin_us)]
    return [("begin", fault.begin_us), ("end", fault.end_us)]
