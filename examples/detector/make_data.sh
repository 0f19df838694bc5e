#!/usr/bin/env bash
# Renders what the shipped detector learns from: about two hours on two cores.
#   DATA=folder/for/pictures SHARED=folder/of/photographs examples/detector/make_data.sh
# SHARED holds aerial_backgrounds, aerial_vehicles, drone_photos, meshes/zx200 and opencv-doc (see README.md).
set -euo pipefail
here="$(cd "$(dirname "$0")" && pwd)"
export SHARED="$(realpath "$SHARED")"
mkdir -p "$DATA"
# Blocks of a thousand, so that a night that is cut short leaves whole ones.
for block in 0 1 2 3 4 5; do
  test -d "$DATA/sim-$block" || standoff simulate dataset --images 1000 --per-scene 10 --held-out 0.1 \
    --seed "10$block" --excavator-mesh "$SHARED/meshes/zx200" --out "$DATA/sim-$block"
done
test -d "$DATA/comp-1" || standoff simulate composites --backgrounds "$here/backgrounds.yaml" --images 1600 --seed 1 \
  --excavator-mesh "$SHARED/meshes/zx200" --out "$DATA/comp-1"
python "$here/label_people.py" "$SHARED/aerial_vehicles" "$here/people.yaml" "$here/unlabelled.yaml" "$DATA"
mkdir -p "$DATA/negatives"
for picture in data/{aero1,aero3,board,building,leuvenA,leuvenB}.jpg data/graf3.png reg/home.png; do
  cp "$SHARED/opencv-doc/examples/$picture" "$DATA/negatives/"
done
