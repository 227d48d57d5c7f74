"""The running stiffness on a thread of its own, so that the force waits for it at no row."""

import queue
import threading
from dataclasses import dataclass

from impid_host.impedance.identify import RobotParameters
from impid_host.live.torques import Rows
from impid_host.live.window import Windowed, look
from impid_host.samples import DeviceSamples
from impid_host.study.model import Setup

Run = tuple[int, int] | None


@dataclass(frozen=True, slots=True)
class Question:
    """The last seconds of both streams, of which run of the module."""

    device: DeviceSamples
    rows: Rows
    run: Run


class Lookout:
    """Works on one question at a time."""

    def __init__(self, setup: Setup, robot: RobotParameters) -> None:
        self._setup, self._robot = setup, robot
        self._questions: queue.SimpleQueue[Question] = queue.SimpleQueue()
        self._answers: queue.SimpleQueue[tuple[Windowed, Run]] = queue.SimpleQueue()
        self.busy = False
        threading.Thread(target=self._work, name="stiffness", daemon=True).start()

    def ask(self, question: Question) -> None:
        """Begin; not while `busy`."""
        self.busy = True
        self._questions.put(question)

    def answer(self) -> tuple[Windowed, Run] | None:
        """What was found and on which run, once; None while nothing is."""
        try:
            found = self._answers.get_nowait()
        except queue.Empty:
            return None
        self.busy = False
        return found

    def _work(self) -> None:
        while True:
            asked = self._questions.get()
            try:
                found = look(asked.device, asked.rows, self._setup, self._robot)
            except Exception as error:
                found = Windowed(float(asked.rows.t[-1]), None, None, f"cannot be worked out ({error!r})")
            self._answers.put((found, asked.run))
