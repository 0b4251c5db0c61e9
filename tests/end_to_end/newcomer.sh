#!/bin/sh
# Times a newcomer's path, from git clone to the first map, with nothing cached: a fresh clone, virtual environment, download of
# the libraries, and kernels not compiled yet. Needs the network. `make newcomer`; PYTHON chooses the interpreter.
set -eu

repository=$(git -C "$(dirname "$0")" rev-parse --show-toplevel)
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
export XDG_CACHE_HOME="$folder/cache" PIP_NO_CACHE_DIR=1
unset NUMBA_CACHE_DIR VENV VIRTUAL_ENV PYTHONPATH MAKEFLAGS MFLAGS MAKELEVEL 2>/dev/null || true

# step WHAT COMMAND...: run it, print how long it took; what it says is shown when it fails.
step() {
    what=$1
    shift
    began=$(date +%s)
    "$@" >"$folder/said" 2>&1 || { cat "$folder/said" >&2; echo "newcomer: $what failed" >&2; exit 1; }
    printf '%-50s %4d s\n' "$what" "$(($(date +%s) - began))"
}

start=$(date +%s)
step "git clone" git clone --quiet "file://$repository" "$folder/gridslam"
cd "$folder/gridslam"
step "make: virtual environment, libraries" make .venv/.ready
step "make map: kernels compiled, first map" make map
test -s out/sample/map.png || { echo "newcomer: there is no picture of the map" >&2; exit 1; }
printf '%-50s %4d s\n' "from git clone to the first map" "$(($(date +%s) - start))"
step "make map again" make map
step "gridslam warmup: all other kernels" .venv/bin/gridslam warmup
