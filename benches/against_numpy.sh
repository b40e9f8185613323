#!/usr/bin/env bash
# Runs the benches `streaming` and `imaging` and the same in numpy and scipy, which it installs into target/numpy, one after
# the other on this machine, and prints how many times as fast tomoswarm is. It takes some minutes.
set -euo pipefail
cd "$(dirname "$0")/.."
python=target/numpy/bin/python
if ! "$python" -c "import numpy, scipy" 2>/dev/null; then
    python3 -m venv target/numpy
    target/numpy/bin/pip install --quiet numpy scipy
fi
cargo bench --no-default-features --bench streaming --bench imaging -- 0 2>/dev/null | tee /dev/stderr | "$python" benches/against_numpy.py
