#!/usr/bin/env bash
# Blends, exports and joins what the two trainings made: the shipped detector and others to compare it with.
#   examples/detector/make_models.sh RUNS
set -euo pipefail
lite="$1/lite" fastest="$1/fastest" out="$1/models"
mkdir -p "$out"
# Half way back to the COCO weights: chosen on real people, see the model card.
standoff blend "$fastest/start.weights=0.5" "$fastest/best.weights=0.5" --cfg "$fastest/network.cfg" --out "$out/people.weights"
for size in 640x384 960x544 1280x736 1920x1088; do
  standoff export --half --cfg "$lite/network.cfg" --weights "$lite/best.weights" --names "$lite/classes.names" \
    --size "$size" --out "$out/lite-$size.onnx"
  standoff export --half --cfg "$fastest/network.cfg" --weights "$out/people.weights" --names "$fastest/classes.names" \
    --size "$size" --out "$out/people-$size.onnx"
  standoff join "$out/lite-$size.onnx=all,worker:0.5" "$out/people-$size.onnx=worker" --out "$out/site-$size.onnx"
done
