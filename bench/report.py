"""Runs every benchmark and prints one table; `make bench` calls it. Figures, machine and versions go to JSON."""

from __future__ import annotations

import argparse
import datetime
import importlib.metadata
import json
import os
import pathlib
import platform
import re
import shutil
import subprocess
import sys
from typing import Any

ROOT = pathlib.Path(__file__).parents[1]


def machine(build: pathlib.Path) -> dict[str, Any]:
    cpuinfo = pathlib.Path("/proc/cpuinfo").read_text()
    cache = (build / "CMakeCache.txt").read_text()

    def entry(name: str) -> str:
        found = re.search(rf"^{name}:\w+=(.*)$", cache, re.MULTILINE)
        return found[1] if found else ""

    compiler = subprocess.run([entry("CMAKE_CXX_COMPILER"), "--version"], capture_output=True, text=True)
    packages = {}
    if shutil.which("dpkg-query"):
        for name in ("libeigen3-dev", "liborocos-kdl-dev", "libbenchmark-dev"):
            query = subprocess.run(["dpkg-query", "-W", "-f=${Version}", name], capture_output=True, text=True)
            packages[name] = query.stdout
    return {
        "date": datetime.datetime.now(datetime.timezone.utc).isoformat(timespec="seconds"),
        "processor": (re.findall(r"model name\s*: (.*)", cpuinfo) or [platform.processor()])[0],
        "cores": os.cpu_count(),
        "avx2": " avx2 " in cpuinfo,
        "load_average": os.getloadavg(),
        "system": platform.platform(),
        "compiler": compiler.stdout.splitlines()[0] if compiler.stdout else "",
        "flags": entry("CMAKE_CXX_FLAGS_" + entry("CMAKE_BUILD_TYPE").upper()),
        "packages": packages,
        "python": platform.python_version(),
        "numpy": importlib.metadata.version("numpy"),
    }


def kernels(build: pathlib.Path, repetitions: int, seconds: float) -> dict[str, dict[str, float]]:
    """Median of the repetitions, which are interleaved at random, by benchmark."""
    found = {}
    for binary in ("sigmaik_bench", "sigmaik_bench_qp"):
        if not (build / binary).exists():  # the QP solvers are optional
            continue
        run = subprocess.run(
            [
                build / binary,
                "--benchmark_format=json",
                "--benchmark_enable_random_interleaving=true",
                f"--benchmark_repetitions={repetitions}",
                f"--benchmark_min_time={seconds}",
            ],
            stdout=subprocess.PIPE,
            check=True,
        )
        for benchmark in json.loads(run.stdout)["benchmarks"]:
            if benchmark.get("aggregate_name") == "median":
                found[benchmark["run_name"].removesuffix("/real_time")] = benchmark
    return found


def instructions(directory: pathlib.Path) -> float | None:
    """Instructions of one Servo::update, baseline instruction set, by callgrind; None where there is no valgrind."""
    if not shutil.which("valgrind"):
        return None
    subprocess.run(
        ["cmake", "-S", ROOT, "-B", directory, "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release"]
        + ["-DSIGMAIK_DISPATCH=OFF", "-DSIGMAIK_BUILD_TESTS=OFF", "-DSIGMAIK_BUILD_EXAMPLES=OFF"],
        stdout=subprocess.DEVNULL,
        check=True,
    )
    subprocess.run(["cmake", "--build", directory, "--target", "sigmaik_cycles"], stdout=subprocess.DEVNULL, check=True)

    def count(cycles: int) -> int:
        run = subprocess.run(
            ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", directory / "sigmaik_cycles"]
            + [str(cycles)],
            capture_output=True,
            text=True,
            check=True,
        )
        found = re.search(r"Collected : (\d+)", run.stderr)
        assert found, run.stderr
        return int(found[1])

    return (count(4096) - count(2048)) / 2048


def draw_latency(rows: list[dict[str, Any]], path: pathlib.Path) -> bool:
    try:
        import matplotlib
    except ImportError:
        return False
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(
        len(rows), 1, figsize=(7, 1.5 * len(rows) + 0.8), sharex=True, layout="constrained", squeeze=False
    )
    for axis, row in zip(axes[:, 0], rows, strict=True):
        bins = row["bins_per_decade_from_100_ns"]
        edges = [0.1 * 10 ** (i / 10) for i in range(len(bins))]
        axis.bar(edges, bins, width=[0.23 * e for e in edges], align="edge", color="#1f77b4")
        axis.set(xscale="log", yscale="log", ylim=(0.5, None))
        axis.set_title(
            f"{row['loop']}, other core {row['other']}: p50 {row['p50'] / 1e3:.2f} µs, "
            f"p99.9 {row['p99.9'] / 1e3:.2f} µs, max {row['max'] / 1e3:.1f} µs",
            fontsize=9,
            loc="left",
        )
    axes[-1, 0].set_xlabel("time of one Servo::update [µs]")
    figure.supylabel("calls", fontsize=9)
    figure.savefig(path, dpi=110)
    return True


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build" / "release")
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "build" / "bench")
    parser.add_argument("--repetitions", type=int, default=9)
    parser.add_argument("--seconds", type=float, default=0.1, help="of each repetition of each benchmark")
    arguments = parser.parse_args()
    out: pathlib.Path = arguments.out
    out.mkdir(parents=True, exist_ok=True)

    result: dict[str, Any] = {"machine": machine(arguments.build)}
    print(json.dumps(result["machine"], indent=1), flush=True)
    ns = kernels(arguments.build, arguments.repetitions, arguments.seconds)
    result["kernels"] = ns
    print("\nlatency", flush=True)
    subprocess.run([arguments.build / "sigmaik_latency", out / "latency.json"], check=True)
    latency = result["latency"] = json.loads((out / "latency.json").read_text())
    print("\npeers", flush=True)
    subprocess.run([sys.executable, ROOT / "bench" / "peers.py", "--json", out / "peers.json"], check=True)
    peers = result["peers"] = json.loads((out / "peers.json").read_text())
    print("\ntime-optimal motions", flush=True)
    command = [
        sys.executable,
        ROOT / "bench" / "time_optimal.py",
        "--pairs",
        "100",
        "--json",
        out / "time_optimal.json",
    ]
    subprocess.run(command, check=True)
    result["time_optimal"] = json.loads((out / "time_optimal.json").read_text())
    print("\nposition inverse kinematics", flush=True)
    command = [sys.executable, ROOT / "bench" / "position_ik_peers.py", "--poses", "300", "--json", out / "ik.json"]
    subprocess.run(command, check=True)
    result["position_ik"] = json.loads((out / "ik.json").read_text())
    result["instructions"] = instructions(ROOT / "build" / "callgrind")

    def cpu(name: str) -> float:
        return float(ns[name]["cpu_time"])

    rows = [
        (f"pose + Jacobian, 7 joints / KDL's pair of {cpu('pose_and_jacobian_kdl'):.0f} ns",
         f"{cpu('pose_and_jacobian_sigmaik'):.0f} ns",
         cpu("pose_and_jacobian_kdl") / cpu("pose_and_jacobian_sigmaik"), 7.0),
        (f"SVD 6×7 warm / Eigen JacobiSVD of {cpu('svd_eigen_jacobi_fixed'):.0f} ns",
         f"{cpu('svd_warm_sigmaik'):.0f} ns", cpu("svd_eigen_jacobi_fixed") / cpu("svd_warm_sigmaik"), 6.0),
        ("SVD 6×7 cold / the same", f"{cpu('svd_cold_sigmaik'):.0f} ns",
         cpu("svd_eigen_jacobi_fixed") / cpu("svd_cold_sigmaik"), 2.5),
        (f"Servo::update(pose) / KDL's wdls of {cpu('velocity_kdl_wdls'):.0f} ns",
         f"{cpu('servo_pose_sigmaik'):.0f} ns", cpu("velocity_kdl_wdls") / cpu("servo_pose_sigmaik"), 4.5),
    ]  # fmt: skip
    for row in latency:
        if row["loop"] == "flat out" and row["other"] == "busy":
            rows.append(("p99.9 / p50, other core busy (at most)", f"{row['p99.9']:.0f} ns",
                         row["p99.9"] / row["p50"], 3.0))  # fmt: skip
    ours = next(row for row in peers if row["name"].startswith("sigmaik"))
    goals = {"Pinocchio + jparse-robotics": 45.0, "Pink, quadprog": 25.0, "Pink, proxqp": 25.0, "mink, daqp": 25.0}
    for row in peers:
        if row["name"] in goals and "ratio" in row:
            rows.append((f"servo.update(pose) from Python / {row['name']}, {row['p50_us']:.0f} µs",
                         f"{ours['p50_us']:.2f} µs", row["ratio"], goals[row["name"]]))  # fmt: skip
    if "constrained_eiquadprog" in ns:
        for name, text in (("constrained_sigmaik", "warm"), ("constrained_sigmaik_cold", "cold")):
            peer = cpu("constrained_eiquadprog")
            rows.append((f"least_squares, 7 unknowns, 3 eq., box, {text} / eiquadprog, {peer:.0f} ns",
                         f"{cpu(name):.0f} ns", peer / cpu(name), 1.5))  # fmt: skip
    rows.append(("ConstrainedIk::step, 2 iterations, optimised / KDL's wdls",
                 f"{cpu('constrained_ik_step'):.0f} ns",
                 cpu("velocity_kdl_wdls") / cpu("constrained_ik_step"), 0.75))  # fmt: skip
    one, two = (float(ns[f"batch/65536/{threads}"]["items_per_second"]) for threads in (1, 2))
    for i, arm in enumerate(("Comau", "Panda", "iiwa")):
        potentials = cpu(f"potential_gradient/{i}")
        for other, text, goal in (
            ("manipulability_determinant_gradient", "√det(JJᵀ) from the Jacobian", 10.0),
            ("manipulability_closed_form_gradient", "m in closed form", 1.0),
        ):
            rows.append((f"{arm}: potentials + gradient / {text}, {cpu(f'{other}/{i}'):.0f} ns",
                         f"{potentials:.0f} ns", cpu(f"{other}/{i}") / potentials, goal))  # fmt: skip
    for plan in result["time_optimal"]:
        ours_ms, ipopt_ms = (plan["median ms"][solver] for solver in ("sigmaik", "ipopt"))
        rows.append((f"time-optimal with potentials, {plan['robot']} / IPOPT, {ipopt_ms:.1f} ms",
                     f"{ours_ms:.2f} ms", plan["ratio of medians"], 2.5))  # fmt: skip
    rows.append(("solve_batch, 6×7 random, million solves / (s core)", f"{one / 1e6:.2f}", one / 1e6, 0.6))
    rows.append(("solve_batch, two threads / one", f"{two / 1e6:.2f}", two / one, 1.9))
    print(f"\n{'figure':62} {'ours':>10} {'ratio':>7} {'goal':>6}")
    for figure, value, ratio, goal in rows:
        met = ratio <= goal if "at most" in figure else ratio >= goal
        print(f"{figure:62} {value:>10} {ratio:7.2f} {goal:6.1f} {'' if met else 'missed'}")
    for name in ("velocity_eiquadprog", "velocity_proxsuite", "constrained_eiquadprog", "constrained_proxsuite"):
        if name in ns:
            print(f"{name + ', for comparison':62} {cpu(name):7.0f} ns")
    for name in (
        "servo_redistribute",
        "servo_scale",
        "constrained_ik_step_switching",
        "analytic_ik_solve",
        "analytic_ik_nearest",
    ):
        print(f"{name:62} {cpu(name):7.0f} ns")
    run = subprocess.run([sys.executable, ROOT / "bench" / "daqp_constrained.py"], capture_output=True, text=True)
    if run.returncode == 0:
        result["daqp"] = json.loads(run.stdout)
        print(f"{'constrained, DAQP, set-up and solve by its own clock':62} {result['daqp']['set_up_ns']:7.0f} ns + "
              f"{result['daqp']['solve_ns']:.0f} ns")  # fmt: skip
    if result["instructions"]:
        print(f"{'instructions of Servo::update, baseline instruction set':62} {result['instructions']:10.0f}")
    result["table"] = rows
    (out / "bench.json").write_text(json.dumps(result, indent=1))
    print(f"\n{out / 'bench.json'}")
    if draw_latency(latency, out / "latency.png"):
        print(out / "latency.png")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
