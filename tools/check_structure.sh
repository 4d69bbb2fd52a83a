#!/usr/bin/env bash
# Checks layers (import-linter) and types (mypy) of the package as it is installed: warp_pd with kernels and scenes in it.
set -euo pipefail
cd "$(dirname "$0")/.."
tree=build/structure
rm -rf "$tree"
mkdir -p "$tree"
cp -r warp_pd "$tree/"
cp -r kernels scenes "$tree/warp_pd/"
(cd "$tree" && PYTHONPATH=. ../../.venv/bin/lint-imports --config ../../pyproject.toml --no-cache)
MYPYPATH="$tree" .venv/bin/mypy
