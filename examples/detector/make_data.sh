#!/usr/bin/env bash
# Renders what the shipped detector learns from: about two hours on two cores.
#   DATA=folder/for/pictures SHARED=folder/of/photographs examples/detector/make_data.sh
# SHARED holds aerial_backgrounds, aerial_vehicles, drone_photos, meshes/zx200 and opencv-doc (see README.md).
# PROCESSES render side by side (2). What is there already is left as it is, so that the script may be stopped and
# started again: a training may begin with the blocks that are ready.
set -euo pipefail
here="$(cd "$(dirname "$0")" && pwd)"
export SHARED="$(realpath "$SHARED")"
processes="${PROCESSES:-2}"
mkdir -p "$DATA"

sites() { # NAME SEED IMAGES HELD_OUT MORE...
  local name="$1" seed="$2" images="$3" held_out="$4"
  shift 4
  test -d "$DATA/$name" || standoff simulate dataset --images "$images" --per-scene 10 --held-out "$held_out" \
    --seed "$seed" --processes "$processes" --quiet --out "$DATA/$name" "$@"
}
composites() { # NAME SEED
  test -d "$DATA/$1" || standoff simulate composites --backgrounds "$here/backgrounds.yaml" --images 400 --seed "$2" \
    --processes "$processes" --quiet --out "$DATA/$1"
}

python "$here/label_people.py" "$SHARED/aerial_vehicles" "$here/people.yaml" "$here/unlabelled.yaml" "$DATA"
mkdir -p "$DATA/negatives"
for picture in data/{aero1,aero3,board,building,leuvenA,leuvenB}.jpg data/graf3.png reg/home.png; do
  cp "$SHARED/opencv-doc/examples/$picture" "$DATA/negatives/"
done
# Small blocks, so that a night that is cut short leaves whole ones; composites in between.
for block in 0 1 2 3; do
  for part in 0 1 2; do
    number=$((3 * block + part))
    sites "sim-$number" $((200 + number)) 400 0.1
    test "$part" != 0 || composites "comp-$block" $((10 + block))
  done
  # Excavators of a mesh that nothing learns from, in scenes that are all held out.
  test "$block" != 0 || sites unseen-mesh 300 120 0.5 --excavator-mesh "$SHARED/meshes/zx200" --mesh-share 1
done
