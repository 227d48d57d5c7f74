"""How many times faster than real time a 50 s trial becomes a study folder, firmware core included."""

import tempfile
import time
from pathlib import Path

from hil_sim.board import layout
from hil_sim.board.native import BoardConfig, NativeBoard
from hil_sim.scenarios.load import load, trial
from hil_sim.study.write import FIRST_US, LEAD_US, stream, write_one_trial
from hil_sim.trials import trial_truth
from hil_sim.world import World


def main() -> None:
    """Writes one trial three times and prints the best factor, then what its parts take."""
    scenario = load("first-light")
    one = trial(scenario, "spring_K1_M1_01")
    layout.database()
    took = []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(3):
            out = Path(folder) / str(number)
            out.mkdir()
            begin = time.process_time()
            write_one_trial(scenario, one, 1, FIRST_US, out, NativeBoard)
            took.append(time.process_time() - begin)
    print(f"plant to study folder: {one.duration_s / min(took):.0f} times real time ({min(took):.2f} s)")

    begin = time.process_time()
    world = World(trial_truth(scenario, one, 1))
    world.begin(LEAD_US)
    for block in range(int(one.duration_s)):
        world.read(1_000_000 * block, 1000)
    sensed = time.process_time() - begin
    print(f"plant and sensors:     {one.duration_s / sensed:.0f} times real time ({sensed:.2f} s)")

    world = World(trial_truth(scenario, one, 1))
    world.begin(FIRST_US + LEAD_US)
    begin = time.process_time()
    for _ in stream(world, NativeBoard(BoardConfig(start_us=FIRST_US))):
        pass
    decoded = time.process_time() - begin
    print(f"plant to samples:      {one.duration_s / decoded:.0f} times real time ({decoded:.2f} s)")


if __name__ == "__main__":
    main()
