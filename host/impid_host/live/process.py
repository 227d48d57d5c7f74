"""The observing process: an order and samples in on stdin, torques on a UDP port, the force out.

Each line in is a piece of samples as the live view gets it; each line out is for the page. It ends with
stdin. Nothing of a recording depends on it.
"""

import json
import os
import sys
import threading
import time
from collections import deque
from contextlib import suppress
from typing import IO, Any

import numpy as np

from impid_host.errors import ImpidError
from impid_host.live.lookout import Lookout, Question
from impid_host.live.observer import Force, LiveForce
from impid_host.live.order import Order, known_robot
from impid_host.live.torques import TorqueReader, open_port, received
from impid_host.live.window import Windowed

_WORK_S = 0.004  # rows that come within it are worked out together
_WAIT_S = 0.05
_LOOK_S = 1.0  # a stiffness each second
_SAY_S = 0.5
_SILENT_S = 1.0
_SWITCH_INTERVAL_S = 0.0005
_LINGER_S = 3.0
_MOST_PIECES = 2000  # of samples that wait, some 20 s
_DIGITS = 6
Json = dict[str, Any]


class _Process:
    def __init__(self, order: Order, log: IO[str] | None) -> None:
        setup = order.apparatus()
        robot, _ = known_robot(order.model, setup)
        self._order, self._log = order, log
        self._port = open_port(order.host, order.port)
        self._reader = TorqueReader(robot.structure.model.joints)
        self._observer = LiveForce(setup, robot, order.window_s)
        self._lookout = Lookout(setup, robot)
        self._pieces: deque[Json] = deque(maxlen=_MOST_PIECES)
        self._ended = threading.Event()
        self._restarts = 0
        self._heard = self._looked = self._said = -np.inf
        self._with_module: bool | None = None

    def run(self) -> None:
        """Until stdin ends."""
        threading.Thread(target=self._listen, name="samples", daemon=True).start()
        while not self._ended.is_set():
            datagrams = received(self._port, _WAIT_S)
            began = time.monotonic()
            while self._pieces:
                self._observer.module.take(self._pieces.popleft())
            self._take(datagrams, began)
            self._look(began)
            if began - self._said > _SAY_S:
                self._said = began
                self._say({"kind": "observer", "words": self._words(began)})
            time.sleep(max(0.0, _WORK_S - (time.monotonic() - began)))

    def _take(self, datagrams: list[bytes], now: float) -> None:
        rows = self._reader.read(datagrams) if datagrams else None
        if self._reader.counts.restarts != self._restarts:
            self._restarts = self._reader.counts.restarts
            self._observer.restart()
        if rows is None:
            return
        self._heard = now
        force = self._observer.take(rows)
        self._with_module = force.with_module
        self._say(self._message(force))

    def _message(self, force: Force) -> Json:
        return {
            "kind": "force",
            "run": self._observer.module.run,
            "t": [round(t, 6) for t in force.t.tolist()],
            "board_s": [round(t, 6) for t in self._on_board(force.t).tolist()],
            "force": [[float(f"{f:.{_DIGITS}g}") for f in row] for row in force.force.tolist()],
            "with_module": force.with_module,
            "host_ns": time.monotonic_ns(),
        }

    def _on_board(self, t: np.ndarray) -> np.ndarray:
        """Instants of the robot's clock on the module's, s; by what came last before they are matched."""
        if self._observer.clock is not None:
            return self._observer.clock.to_device(t)
        arrived = self._observer.module.arrived_s
        return t if arrived is None else t - t[-1] + arrived

    def _look(self, now: float) -> None:
        answer = self._lookout.answer()
        if answer is not None:
            found, run = answer
            if found.clock is not None:
                self._observer.matched(found.clock, run)
            self._say(self._stiffness(found, run))
        if self._lookout.busy or now - self._looked < _LOOK_S or now - self._heard > _SILENT_S:
            return
        last, run = self._observer.last(), self._observer.module.run
        if last is not None:
            self._looked = now
            self._lookout.ask(Question(*last, run))

    def _stiffness(self, found: Windowed, run: tuple[int, int] | None) -> Json:
        clock = found.clock
        message: Json = {
            "kind": "stiffness",
            "run": run,
            "t": found.t_robot,
            "board_s": None if clock is None else float(clock.to_device(np.array(found.t_robot))),
            "window_s": self._order.window_s,
            "reason": found.reason,
            "host_ns": time.monotonic_ns(),
        }
        if found.load is not None:
            K = found.load.K
            message |= {"axes": found.load.model.axes, "unit": K.unit}
            message |= {"K": K.value.tolist(), "ci95": K.ci95.tolist()}
        return message

    def _words(self, now: float) -> str:
        counts = self._reader.counts
        if not counts.rows:
            waits = f"waiting for the robot's torques at UDP {self._order.host}:{self._order.port}"
            return f"{waits}; {counts.unreadable} lines that are no row" if counts.unreadable else waits
        words = []
        if now - self._heard > _SILENT_S:
            words.append(f"no torques for {now - self._heard:.0f} s")
        words.append("with the accelerometer" if self._with_module else "by the robot's angles alone")
        if counts.missing:
            words.append(f"{counts.missing} of {counts.rows + counts.missing} rows are missing")
        if counts.unreadable:
            words.append(f"{counts.unreadable} lines are no row")
        return "; ".join(words)

    def _say(self, message: Json) -> None:
        line = json.dumps(message, separators=(",", ":")) + "\n"
        sys.stdout.write(line)
        sys.stdout.flush()
        if self._log is not None:
            try:
                self._log.write(line)
                if message["kind"] != "force":
                    self._log.flush()
            except OSError as error:
                self._log = None
                self._say(
                    {"kind": "observer", "words": f"{self._order.log}: {error.strerror}; not logged further"}
                )

    def _listen(self) -> None:
        for line in sys.stdin:
            self._pieces.append(json.loads(line))
        self._ended.set()
        time.sleep(_LINGER_S)
        os._exit(1)  # whatever it hangs on, nobody listens any more


def main() -> None:
    """Observe until stdin ends."""
    sys.setswitchinterval(_SWITCH_INTERVAL_S)
    order = Order.from_dict(json.loads(sys.stdin.readline()))
    try:
        log = None if order.log is None else order.log.open("x", encoding="utf-8")
        process = _Process(order, log)
    except (ImpidError, OSError) as error:
        print(json.dumps({"kind": "observer", "words": str(error)}), flush=True)  # noqa: T201
        return
    with suppress(BrokenPipeError):
        process.run()
    if log is not None:
        with suppress(OSError):
            log.close()


if __name__ == "__main__":
    main()
