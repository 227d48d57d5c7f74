"""The process that works on studies, one after the other: requests in by standard input, answers out.

                                               -> ready
    {"study": "/data/p07", "options": {...}}   -> the study's hash and key
    {"go": true}                               -> what was found out about it

A process of its own, so that a study that breaks it, or takes too long, harms no other. It ends with its
parent: standard input then ends too, and a thread watches it even while a fit is running.
"""

import json
import os
import queue
import sys
import threading
from contextlib import ExitStack
from typing import IO, Any

from impid_host.batch.look import broken, looked_at
from impid_host.batch.one_study import worked_out
from impid_host.batch.places import study_folder
from impid_host.batch.task import Answer, BatchOptions
from impid_host.errors import ImpidError


def main() -> None:
    """Answer until standard input ends."""
    # What a library prints must not come between the answers.
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    requests: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
    threading.Thread(target=_read, args=(requests,), daemon=True).start()
    answers.write("ready\n")
    answers.flush()
    while True:
        request = requests.get()
        with ExitStack() as kept:
            options = BatchOptions(request["options"]["diagnose"], tuple(request["options"]["terms"]))
            address = request["study"]
            try:
                folder = kept.enter_context(study_folder(address))
            except (ImpidError, OSError) as error:
                _say(answers, broken(Answer(address, "unreadable"), error))
                continue
            first = looked_at(address, folder, options)
            _say(answers, first)
            if first.status == "fitted" and requests.get()["go"]:
                _say(answers, worked_out(first, folder, options))


def _read(requests: "queue.SimpleQueue[dict[str, Any]]") -> None:
    for line in sys.stdin:
        requests.put(json.loads(line))
    os._exit(0)


def _say(answers: IO[str], answer: Answer) -> None:
    answers.write(answer.to_json() + "\n")
    answers.flush()


if __name__ == "__main__":
    main()
