"""What a piece of work costs: in a process of its own, one thread for linear algebra, preparation not counted.

A job is a generator: what stands before its `yield` prepares, what stands after it is measured. What it yields
is kept: the number of samples, say.
"""

import importlib
import inspect
import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
Job = Callable[..., Iterator[Any]]


@dataclass(frozen=True)
class Cost:
    """Processor and wall time in s, largest memory of the process in MB, what the job yielded."""

    cpu_s: float
    wall_s: float
    peak_MB: float
    about: Any

    @property
    def rate(self) -> float:
        """What was yielded, a second of processor time."""
        return float(self.about) / self.cpu_s


def cost(job: Job, *arguments: Any, times: int = 1) -> Cost:
    """The least of several runs, each a process of its own."""
    command = [
        sys.executable,
        "-m",
        "speed.measure",
        _module(job),
        job.__name__,
        json.dumps(arguments),
    ]
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    path = os.pathsep.join([str(ROOT / "host"), str(ROOT), str(ROOT / "bench")])
    environment = {**os.environ, **threads, "PYTHONPATH": path}
    costs = []
    for _ in range(times):
        done = subprocess.run(command, capture_output=True, text=True, env=environment, cwd=ROOT, check=False)
        if done.returncode:
            raise RuntimeError(f"{job.__name__}{arguments}: {done.stderr.strip().splitlines()[-1]}")
        costs.append(Cost(*json.loads(done.stdout.splitlines()[-1])))
    return min(costs, key=lambda one: one.cpu_s)


def _module(job: Job) -> str:
    """By which another process imports it, also where it is the program itself, by `-m` or by its path."""
    module = sys.modules[job.__module__]
    if module.__spec__ is not None:
        return module.__spec__.name
    return Path(inspect.getfile(job)).stem


def main() -> None:
    """Run one job and print its cost."""
    module, name, arguments = sys.argv[1:]
    work = getattr(importlib.import_module(module), name)(*json.loads(arguments))
    about = next(work)
    begin = time.process_time(), time.perf_counter()
    next(work, None)
    spent = time.process_time() - begin[0], time.perf_counter() - begin[1]
    print(json.dumps([*spent, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024, about]))


if __name__ == "__main__":
    main()
