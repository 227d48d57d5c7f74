#!/usr/bin/env bash
# The main job on the simulator: record four trials over a pseudo-terminal, synchronise, identify, plot,
# and hold the result against what the simulator knows; then find what another study hides. Everything it
# writes goes into demo-output/.
set -euo pipefail
cd "$(dirname "$0")/.."

scenario=first-light
trials=(free_01 free_02 spring_K1_M1_01 spring_K5_M3_01)
seed=7
speed=10
out=demo-output/$(date +%Y%m%d-%H%M%S)
mkdir -p "$out/truth"

say() { printf '\n\033[1m%s\033[0m\n' "$*"; }

# --truth is for this check alone: the simulator writes it to a folder that the host never reads.
recordings=()
for trial in "${trials[@]}"; do
  say "record $trial: 50 s of board time, $speed times faster"
  impid-host record --sim "$scenario:$trial" --seed "$seed" --speed "$speed" \
    --out "$out/$trial.mcap" --truth "$out/truth/$trial.json"
  recordings+=("$out/$trial.mcap")
done

say "export: recordings and torque logs become a study folder"
impid-host export "${recordings[@]}" --out "$out/study"

say "sync: the board's clock against the robot's"
impid-host sync "$out/study" --json "$out/sync.json"

say "fit: the robot, then each load, without and with the force sensor"
impid-host fit "$out/study" --json "$out/fit.json" --figures "$out/figures"

say "the result against the simulator's truth"
python scripts/demo_check.py "$out"

say "diagnose: a study in which the simulator hides something from the host"
impid-sim study hidden-friction --seed "$seed" --out "$out/hidden" --truth "$out/truth/hidden.json"
impid-host diagnose "$out/hidden" --json "$out/diagnosis.json" --figures "$out/diagnosis"
echo
echo "what was hidden:"
python scripts/demo_hidden.py "$out/truth/hidden.json" "$out/diagnosis.json"

echo
echo "figures: $out/figures, $out/diagnosis"
