#!/usr/bin/env bash
# Bundles the libraries of the page into warp_pd/viewer/page; needs Node, and npm's registry. Run it after a change of
# a version in package.json or of entry.js.
set -euo pipefail
cd "$(dirname "$0")"
page=$(realpath ../../warp_pd/viewer/page)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cp package.json package-lock.json entry.js "$work"
cd "$work"
npm ci --silent
npx esbuild entry.js --bundle --minify --format=iife --global-name=vendor --outfile=bundle.js --log-level=warning
version() { node -p "require('./node_modules/$1/package.json').version"; }
{
  echo "/*! three.js $(version three) and its OrbitControls; uPlot $(version uplot). MIT licence, see LICENSES.txt. Made by tools/page_scripts/build.sh. */"
  cat bundle.js
} > "$page/vendor.js"
cp node_modules/uplot/dist/uPlot.min.css "$page/vendor.css"
for name in three uplot; do
  printf '%s\n\n' "$name, in vendor.js"
  cat "node_modules/$name/LICENSE"
  echo
done > "$page/LICENSES.txt"
