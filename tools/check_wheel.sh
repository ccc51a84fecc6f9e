#!/usr/bin/env bash
# Installs a wheel in an empty environment, and makes sure that it works there and brings its libraries: no shared
# object in it may need anything from outside but the C and C++ runtimes. check_wheel.sh WHEEL
set -euo pipefail
wheel=$(realpath "$1")
cd "$(dirname "$0")/.."
rm -rf build/wheel-check
.venv/bin/python -m venv build/wheel-check
cd build/wheel-check
bin/python -m pip install -q "$wheel"

# Nothing but numpy is there: the command line must do without.
bin/sigmaik robots >/dev/null
bin/sigmaik info ufactory_xarm7 --samples 10 >/dev/null
bin/sigmaik reach --robot ur10 --method dls --limits off --rate 5 --format none --no-plot --out reach >/dev/null

bin/python - <<'PYTHON'
import pathlib, re, subprocess, sys, sysconfig

site = pathlib.Path(sysconfig.get_path("platlib"))
objects = [p for d in ("sigmaik", "sigmaik.libs") for p in (site / d).rglob("*.so*")]
ours = {p.name for p in objects}
system = re.compile(r"(libc|libm|libstdc\+\+|libgcc_s|libdl|libpthread|librt)\.so\.\d+|ld-linux.*")
outside = {}
for path in objects:
    dynamic = subprocess.run(["readelf", "-d", path], capture_output=True, text=True, check=True).stdout
    for name in re.findall(r"\(NEEDED\).*\[(.*)\]", dynamic):
        if name not in ours and not system.fullmatch(name):
            outside.setdefault(name, []).append(path.name)
if not objects or outside:
    sys.exit(f"libraries from outside the wheel: {outside or 'no shared object in it'}")

import numpy as np
import sigmaik as sk

chain = sk.robots.load("ufactory_xarm7")
q = np.ones(chain.dof)
twist = np.array([0.05, 0.0, 0.0, 0.0, 0.0, 0.0])
solution = sk.VelocitySolver(sk.JParse()).solve(chain.jacobian(q), twist)
assert solution.status == sk.Status.OK, solution
assert np.allclose(chain.jacobian(q) @ solution.qdot, twist, atol=1e-9), solution

loaded = {line.split()[-1] for line in open("/proc/self/maps") if "/" in line}
foreign = [p for p in loaded if re.search(r"orocos|urdfdom|tinyxml|console_bridge", p) and not p.startswith(str(site))]
if foreign:
    sys.exit(f"loaded from outside the wheel: {foreign}")
print(f"wheel: ok, sigmaik {sk.__version__} on {sys.version.split()[0]}, carries {len(ours) - 1} libraries")
PYTHON
