#!/usr/bin/env bash
# Installs, compares the GPU with the CPU, and trains what this archive holds. Started again, it goes on.
#   ./run.sh [more for standoff train, such as --set batch=64 --set workers=8]
# STEPS=10          so many steps in place of the plan's, to try
# OUT=folder        of the run (run, beside this file)
# PYTHON=python     that has everything already: nothing is installed
# BASE_PYTHON=python3.12   to make the environment with, in place of python3
# TORCH_INDEX=URL   where pip finds torch for this machine's CUDA, if neither the machine nor the archive has one
# SHARED=folder     of photographs, for an archive with the recipe of its data
# ANYWAY=1          train although GPU and CPU differ
set -euo pipefail
out="$(realpath -m "${OUT:-"$(dirname "$0")/run"}")"
if [ -n "${PYTHON:-}" ]; then
  PYTHON="$(realpath -s "$(command -v "$PYTHON")")" || { echo "run.sh: PYTHON=$PYTHON is no program" >&2; exit 2; }
fi
if [ -n "${SHARED:-}" ]; then SHARED="$(realpath "$SHARED")"; fi
cd "$(dirname "$0")"
if [ -d recipe ] && [ -z "${SHARED:-}" ]; then
  echo "run.sh: the data are to be made here: set SHARED=folder of photographs (see examples/detector/README.md)" >&2
  exit 2
fi

pip() { "$PYTHON" -m pip --quiet --disable-pip-version-check "$@"; }

install() {
  local packed=()
  if [ -d wheels ]; then packed=(--no-index --find-links wheels); fi
  # The wheels are beside requirements.txt; the lock has the versions that were tested together.
  pip install "${packed[@]}" --constraint requirements.lock --requirement requirements.txt
  if ! "$PYTHON" -c 'import torch' 2>/dev/null; then
    if compgen -G 'wheels/torch-*.whl' >/dev/null; then
      pip install "${packed[@]}" torch
    else
      pip install --constraint requirements.lock ${TORCH_INDEX:+--extra-index-url "$TORCH_INDEX"} torch
    fi
  fi
  if command -v nvidia-smi >/dev/null; then
    local version
    version="$("$PYTHON" -c 'import importlib.metadata as m; print(m.version("onnxruntime"))')"
    # Both have the same files: the one must be gone before the other comes.
    pip uninstall --yes onnxruntime
    pip install "${packed[@]}" --no-deps "onnxruntime-gpu==$version" || {
      echo "run.sh: no onnxruntime-gpu $version: ONNX Runtime stays on the CPU" >&2
      pip install "${packed[@]}" --no-deps "onnxruntime==$version"
    }
  else
    echo "run.sh: no NVIDIA driver here: everything stays on the CPU" >&2
  fi
}

if [ -z "${PYTHON:-}" ]; then
  base="${BASE_PYTHON:-python3}"
  "$base" -c 'import sys; sys.exit(sys.version_info < (3, 11))' ||
    { echo "run.sh: standoff needs Python 3.11 or newer: set BASE_PYTHON" >&2; exit 2; }
  own=()
  # A torch that is there already was made for this machine.
  if "$base" -c 'import torch' 2>/dev/null; then own=(--system-site-packages); fi
  PYTHON="$PWD/venv/bin/python"
  if [ ! -e venv/.ready ]; then
    "$base" -m venv --clear "${own[@]}" venv
    install
    touch venv/.ready
  fi
fi
"$PYTHON" -c 'import torch; print("torch", torch.__version__, "CUDA", torch.cuda.is_available())'

standoff() { "$PYTHON" -m standoff "$@"; }

if [ -d recipe ]; then
  PATH="$(dirname "$PYTHON"):$PATH" DATA="$PWD/data" SHARED="$SHARED" bash recipe/make_data.sh
  if grep -q 'data/photographs' mixture.yaml && [ ! -d data/photographs ]; then
    "$PYTHON" recipe/take_photographs.py "$SHARED/site_photographs" recipe/real_points.yaml data
  fi
fi

if [ ! -e compared.json ]; then
  if standoff bench --providers --training plan.yaml --json comparing.json; then
    mv comparing.json compared.json
  elif [ -z "${ANYWAY:-}" ]; then
    echo "run.sh: not trained, because of the above; ANYWAY=1 trains all the same" >&2
    exit 1
  fi
fi

options=()
if [ -n "${STEPS:-}" ]; then
  options=(--set "steps=$STEPS")
  warmup="$(sed -n 's/^  warmup_steps: //p' plan.yaml)"
  # A warm-up has to end before the run does.
  if [ ! -d "$out/checkpoints" ] && [ "$warmup" -ge "$STEPS" ]; then options+=(--set "warmup_steps=$((STEPS / 10))"); fi
fi
if [ -d "$out/checkpoints" ]; then
  standoff train --resume --out "$out" "${options[@]}" "$@"
else
  standoff train --config plan.yaml --out "$out" "${options[@]}" "$@"
fi
