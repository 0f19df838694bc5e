#!/usr/bin/env bash
# Blends, exports and joins what the trainings made: the shipped detector, the finalists, and what they are compared with.
#   examples/detector/make_models.sh RUNS
set -euo pipefail
runs="$1" out="$1/models"
mkdir -p "$out"
# Part of the way back to the COCO weights: chosen on real people, see the model card.
standoff blend "$runs/fastest/start.weights=0.5" "$runs/fastest/best.weights=0.5" \
  --cfg "$runs/fastest/network.cfg" --out "$out/people.weights"

export_run() { # RUN WEIGHTS SIZE NAME
  standoff export --half --cfg "$runs/$1/network.cfg" --names "$runs/$1/classes.names" --weights "$2" --size "$3" \
    --out "$out/$4-$3.onnx"
}
for size in 640x384 960x544 1280x736 1920x1088; do
  export_run lite_more "$runs/lite_more/best.weights" "$size" lite
  export_run fastest "$out/people.weights" "$size" people
  export_run fastest "$runs/fastest/best.weights" "$size" fastest
  export_run tiny "$runs/tiny/best.weights" "$size" tiny
  standoff join "$out/lite-$size.onnx=all,worker:1" "$out/people-$size.onnx=worker" --out "$out/site-$size.onnx"
done
