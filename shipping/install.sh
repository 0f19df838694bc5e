#!/bin/sh
# Install standoff from this folder into a virtual environment of its own; needs no network.
#   sh install.sh [FOLDER]      where to: standoff-env beside you by default; PYTHON=... for another Python
set -eu
target=${1:-standoff-env}
case $target in /*) ;; *) target=$PWD/$target ;; esac
cd "$(dirname "$0")"
python=${PYTHON:-python3}
wanted=$(cat python-version)
found=$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])') || found="none"
if [ "$found" != "$wanted" ]; then
  echo "install.sh: expected Python $wanted, for which these wheels are; found $found. Set PYTHON=/path/to/python$wanted." >&2
  exit 2
fi
if ! sha256sum --check --quiet SHA256SUMS; then
  echo "install.sh: expected the files that SHA256SUMS lists; these differ. Copy the folder again." >&2
  exit 2
fi
if ! "$python" -m venv "$target"; then
  echo "install.sh: expected Python's venv module; on Debian and Ubuntu it is the package python3-venv." >&2
  exit 2
fi
# No setting of this computer's pip may lead elsewhere.
env PIP_CONFIG_FILE=/dev/null PIP_FIND_LINKS= PIP_CONSTRAINT= "$target/bin/python" -m pip install --quiet \
  --disable-pip-version-check --no-index --find-links wheels --requirement requirements.txt
"$target/bin/standoff" --version
echo "Installed in $target. Try: $target/bin/standoff demo --out demo"
