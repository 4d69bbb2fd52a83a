#!/usr/bin/env bash
# Sets up an environment in .venv on the first call, then runs. Warp brings what it needs for a GPU and for a CPU.
#   tools/start.sh test               lint, layers, types, tests; these take torch too, for the neural law
#   tools/start.sh test SUBJECT ...   the same with the tests of the core and of subjects alone, such as tearing
#   tools/start.sh docs               docs/ and the API as a site, in site/
#   tools/start.sh run SCENE ...      warp-pd run SCENE ..., and so for plan, list, info, warm
set -euo pipefail
cd "$(dirname "$0")/.."

extras=""
if [ "${1:-}" = test ]; then extras="[neural,test]"; fi
if [ "${1:-}" = docs ]; then extras="[docs]"; fi
stamp=".venv/installed${extras}-$(cksum < pyproject.toml | cut -d' ' -f1)"
if [ ! -e "$stamp" ]; then
  if [ ! -x .venv/bin/python ]; then "${PYTHON:-python3}" -m venv .venv; fi
  # Without byte code, which takes half a minute for all packages; Python makes that of the files that it imports.
  install=(.venv/bin/python -m pip install --quiet --no-compile)
  # By its version, first: where a file for CPUs is at hand it is taken, and gigabytes of CUDA packages are not.
  if [ "${1:-}" = test ]; then "${install[@]}" torch==2.13.0; fi
  "${install[@]}" --editable ".$extras"
  touch "$stamp"
fi

if [ "${1:-}" = test ]; then
  shift
  # Not the scenes that a user keeps beside them.
  parts=(docs kernels scenes tests tools warp_pd)
  .venv/bin/ruff check "${parts[@]}"
  .venv/bin/ruff format --check "${parts[@]}"
  # Beside the tests: it takes one core half a minute.
  bash tools/check_structure.sh & structure=$!
  status=0
  # Names of subjects come first; pytest takes the rest.
  chosen=()
  while [ "${1:-}" ] && [[ "$1" =~ ^[a-z]+$ ]] && [ -d "tests/$1" ]; do
    chosen+=("tests/$1")
    shift
  done
  if [ "${#chosen[@]}" -gt 0 ]; then chosen=(tests/core "${chosen[@]}"); fi
  # Hundreds of processes start Python. Byte code is kept also where the environment asks for none beside the sources.
  export PYTHONPYCACHEPREFIX="$PWD/.venv/byte_code"
  unset PYTHONDONTWRITEBYTECODE
  # One process a core: further threads of OpenBLAS and torch would spin there, and take longer than what they compute.
  export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1
  # Tests of a file share kernels: one process compiles them once. tests/conftest.py orders the files.
  .venv/bin/python -m pytest -n "${TEST_PROCESSES:-2}" --dist loadfile --no-loadscope-reorder ${chosen[@]+"${chosen[@]}"} "$@" ||
    status=$?
  wait "$structure" || { echo "LAYERS OR TYPES: see the messages of tools/check_structure.sh above"; status=1; }
  exit "$status"
fi
if [ "${1:-}" = docs ]; then
  shift
  exec .venv/bin/mkdocs build --strict "$@"
fi
exec .venv/bin/warp-pd "$@"
