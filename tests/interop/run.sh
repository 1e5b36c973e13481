#!/usr/bin/env bash
# Tables are readable without pegfit: bakes a small one and opens it with zarr-python and
# xarray of the pinned versions, in a virtual environment of its own.
# usage: tests/interop/run.sh [PEGFIT]      (default: target/release/pegfit)
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
pegfit=$(realpath "${1:-$root/target/release/pegfit}")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check -r "$here/requirements.txt"
cp "$root"/fixtures/rectangular_*.obj "$here/scene.toml" "$work"
cd "$work"
"$pegfit" bake scene.toml -o table.zarr --quiet
venv/bin/python "$here/check.py" "$pegfit" table.zarr
