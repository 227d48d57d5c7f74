#!/usr/bin/env bash
# The main job on the simulator: record four trials over a pseudo-terminal, synchronise, identify, plot,
# and hold the result against what the simulator knows. Everything it writes goes into demo-output/.
set -euo pipefail
cd "$(dirname "$0")/.."

scenario=first-light
trials=(free_01 free_02 spring_K1_M1_01 spring_K5_M3_01)
seed=7
speed=10
out=demo-output/$(date +%Y%m%d-%H%M%S)
mkdir -p "$out/truth"

say() { printf '\n\033[1m%s\033[0m\n' "$*"; }

# The simulator is started by hand here, as one would plug in a board, because the demo also wants its truth,
# in a folder that the host never reads. `impid-host record --sim` does both steps in one.
for trial in "${trials[@]}"; do
  say "record $trial: 50 s of board time, $speed times faster"
  impid-sim serve "$scenario" --trial "$trial" --seed "$seed" --speed "$speed" --link "$out/board" \
    --robot-log "$out/$trial.robot.csv" --setup "$out/$trial.setup.toml" --truth "$out/truth/$trial.json" \
    >"$out/$trial.sim.log" &
  until [ -e "$out/board" ]; do sleep 0.05; done
  impid-host record --port "$out/board" --duration 50 --out "$out/$trial.mcap"
  wait
done

say "export: recordings and torque logs become a study folder"
recordings=("${trials[@]/#/$out/}")
impid-host export "${recordings[@]/%/.mcap}" --out "$out/study"

say "sync: the board's clock against the robot's"
impid-host sync "$out/study" --json "$out/sync.json"

say "fit: the robot, then each load, without and with the force sensor"
impid-host fit "$out/study" --json "$out/fit.json" --figures "$out/figures"

say "the result against the simulator's truth"
python scripts/demo_check.py "$out"
echo "figures: $out/figures"
