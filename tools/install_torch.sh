#!/usr/bin/env bash
# Installs PyTorch built for CPUs (about 200 MB) for the tests of the policy of `sigmaik learn`; where there is none, these
# tests are skipped. A plain `pip install torch` on Linux brings several GB of CUDA with it.
#
#     install_torch.sh PYTHON
set -uo pipefail
python=$1
"$python" -c 'import importlib.util as u; raise SystemExit(u.find_spec("torch") is None)' && exit 0
install() { "$python" -m pip install -q --no-compile --retries 1 "$@" 2>/dev/null; }
install 'torch==2.13.0+cpu' || install --index-url https://download.pytorch.org/whl/cpu torch ||
  echo "no PyTorch for CPUs: the tests of the policy will be skipped" >&2
