#!/usr/bin/env bash
# Everything that the pages say of a folder of weights, measured anew:
#
#     bash benchmarks/figures.sh WEIGHTS OUT [SHARED] [SEED]
#
# OUT gets the files of docs/results; what is there already is not measured again, so that it can be stopped and
# begun again. SHARED is the folder of scanned meshes and captures. SEED decides the views: one that no
# weights were looked at with. About an hour and a half on two cores.
set -euo pipefail
weights=$1 out=$2 shared=${3:-../shared/data} seed=${4:-62}
mkdir -p "$out/scans"

evaluate() {  # NAME OPTIONS...
  local file=$out/$1.json
  [[ -f $file ]] || ffhnet evaluate --weights "$weights" --json "$file" "${@:2}"
}

[[ -f $weights/calibration.json ]] ||
  ffhnet calibrate "$weights" --objects procedural-val:144,varied-val:64 --fit 64 --views 2
evaluate kit_test --objects "$shared/meshes/kit_test" --placements 25 --poses all --executed 40 --stress --seed "$seed"
few=(--placements 2 --poses all --executed 40 --full-views 0 --seed "$seed")
evaluate procedural_test --objects procedural-test:24 "${few[@]}" --stress
evaluate varied_test --objects varied-test:24 "${few[@]}" --heuristic 0
for set in ycb gso contactdb hope; do
  [[ -d $out/scans/$set ]] || ffhnet objects import "$shared/meshes/$set" --out "$out/scans/$set"
  evaluate scans_$set --objects "$out/scans/$set" "${few[@]}" --heuristic 0
done
evaluate kit_test_density_100 --objects "$shared/meshes/kit_test" --placements 6 --poses all --executed 60 --full-views 0 --strict \
  --density 100 --seed $((seed + 1))
python benchmarks/captures.py "$shared/captures" --weights "$weights" --json "$out/captures.json"
evaluate arm --protocol arm --objects procedural-test:200 --placements 1 --seed "$seed"
evaluate arm_clutter --protocol arm --objects procedural-test:120 --placements 1 --neighbours 2 --seed "$seed"
