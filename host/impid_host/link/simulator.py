"""Starts `impid-sim serve` as a program of its own, as one would plug in a board."""

import json
import queue
import shutil
import subprocess
import sys
import tempfile
import threading
from pathlib import Path
from types import TracebackType
from typing import IO, Any, Self

from impid_host.errors import LinkError

_READY_S = 60.0
_STOP_S = 10.0


class Simulator:
    """A running simulator that serves one trial on a pseudo-terminal; leave the context to stop it.

    The robot's own torque log and the apparatus are written to the two given files by the simulator.
    """

    def __init__(self, process: subprocess.Popen[str], errors: IO[str]) -> None:
        self._process = process
        self._errors = errors
        self._lines: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._finished = threading.Event()
        threading.Thread(target=self._read, name="impid-sim", daemon=True).start()
        try:
            self.port, self.trial = self._await_port()
        except BaseException:
            self.stop()
            raise

    @classmethod
    def start(
        cls,
        scenario: str,
        *,
        speed: float,
        seed: int | None,
        robot_log: Path,
        setup: Path,
        truth: Path | None = None,
        torques_to: str | None = None,
    ) -> Self:
        """Serve SCENARIO:TRIAL, or the first trial of SCENARIO, and wait until its port is there.

        `truth` is where the simulator writes what it hides; nothing here reads that. `torques_to` is where
        its robot sends each row of the torque log at once, HOST:PORT.

        Raises:
            LinkError: the simulator is not installed or refuses; says why.
        """
        program = shutil.which("impid-sim", path=str(Path(sys.executable).parent)) or shutil.which(
            "impid-sim"
        )
        if program is None:
            raise LinkError(
                "impid-sim is not installed here; install impid with its simulator (pip install 'impid[sim]')"
            )
        name, _, trial = scenario.partition(":")
        command = [program, "serve", name, "--speed", f"{speed:g}", "--until-stdin-closes"]
        command += ["--trial", trial] if trial else []
        command += ["--robot-log", str(robot_log), "--setup", str(setup)]
        command += ["--seed", str(seed)] if seed is not None else []
        command += ["--truth", str(truth)] if truth is not None else []
        command += ["--torques-to", torques_to] if torques_to is not None else []
        errors = tempfile.TemporaryFile("w+", encoding="utf-8")  # noqa: SIM115  (closed by stop)
        process = subprocess.Popen(
            command,
            # Never written to: it closes when this program ends, however it ends, and the simulator with it.
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=errors,
            text=True,
            # Ctrl-C is for the recorder, which then stops the board in good order.
            start_new_session=True,
        )
        return cls(process, errors)

    @property
    def finished(self) -> bool:
        """The simulated trial is over: the robot's log is complete."""
        return self._finished.is_set()

    def stop(self) -> None:
        """Have it write its log and end; it is killed if it does not."""
        if self._process.poll() is None:
            self._process.terminate()
        try:
            self._process.wait(_STOP_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        if self._process.stdin is not None:
            self._process.stdin.close()
        self._errors.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def _read(self) -> None:
        if self._process.stdout is not None:
            for line in self._process.stdout:
                self._lines.put(line)
                if _announced(line).get("event") == "trial-finished":
                    self._finished.set()
        self._lines.put(None)
        self._finished.set()  # a simulator that has gone will bring no more

    def _await_port(self) -> tuple[str, str]:
        while True:
            try:
                line = self._lines.get(timeout=_READY_S)
            except queue.Empty:
                raise LinkError(f"impid-sim named no port within {_READY_S:.0f} s") from None
            if line is None:
                self._process.wait()
                self._errors.seek(0)
                said = self._errors.read().strip().splitlines()
                raise LinkError(said[-1] if said else "impid-sim ended before it named a port")
            ready = _announced(line)
            if "port" in ready:
                return str(ready["port"]), str(ready.get("trial", ""))


def _announced(line: str) -> dict[str, Any]:
    try:
        announced = json.loads(line)
    except ValueError:
        return {}
    return announced if isinstance(announced, dict) else {}
