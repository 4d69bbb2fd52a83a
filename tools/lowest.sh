#!/usr/bin/env bash
# Installs the lowest versions that pyproject.toml allows, once with the lowest NumPy and once with NumPy 2, and runs
# every tenth test with each. To be run when a bound changes.
#
#     tools/lowest.sh                             # two new environments in build/, some ten minutes
#     EVERY=100 tools/lowest.sh tests/core/output # fewer tests, of some files
set -euo pipefail
cd "$(dirname "$0")/.."
folders=("${@:-tests}")
status=0
for numpy in "numpy" "numpy>=2"; do
    environment=build/lowest
    rm -rf "$environment"
    python3 -m venv "$environment"
    "$environment/bin/pip" install -q uv
    VIRTUAL_ENV="$environment" "$environment/bin/uv" pip install --quiet --resolution lowest-direct \
        --only-binary :all: --no-binary warp-pd . "$numpy" "pytest>=8" "hypothesis>=6.100" "scikit-fem>=10"
    # The version that tools/start.sh takes, for the reason that stands there; last, since it brings newer ones of others.
    "$environment/bin/pip" install -q torch==2.13.0
    VIRTUAL_ENV="$environment" "$environment/bin/uv" pip list
    # Not those that need a browser, a GPU or the tools of a developer.
    mapfile -t tests < <("$environment/bin/pytest" --collect-only -q --ignore=tests/browser --ignore=tests/gpu \
        --ignore=tests/tools "${folders[@]}" | grep :: \
        | awk -v every="${EVERY:-10}" 'NR % every == 0')
    "$environment/bin/pytest" -q -p no:cacheprovider "${tests[@]}" || status=$?
done
exit "$status"
