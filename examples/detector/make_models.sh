#!/usr/bin/env bash
# Blends, exports and joins what the trainings made: the shipped detector, the finalists, and what they are compared with.
#   examples/detector/make_models.sh RUNS      ($DATA as for the trainings)
set -euo pipefail
runs="$1" out="$1/models"
mkdir -p "$out"
# Part of the way back to the COCO weights: chosen on real people, see the model card.
standoff blend "$runs/fastest/start.weights=0.6" "$runs/fastest/best.weights=0.4" \
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
  # Workers a little less sure, so that what only one of the two takes for somebody starts no track.
  standoff join "$out/lite-$size.onnx=all,worker:0.85" "$out/people-$size.onnx=worker:0.85" --out "$out/site-$size.onnx"
done
# In eight bits only the first: the second is small, and holds what must not be lost.
standoff quantize "$out/lite-1280x736.onnx" --data "$(dirname "$0")/mixture.yaml" --out "$out/lite-int8.onnx"
standoff join "$out/lite-int8.onnx=all,worker:0.85" "$out/people-1280x736.onnx=worker:0.85" --out "$out/site-int8.onnx"
