"""A motion in little time that keeps clear of singularities, and what it costs. The same as
06_clear_of_singularities.cpp."""

import sigmaik as sk

arm = sk.robots.load("ufactory_xarm7")
start = [-1.0, -0.5, 0.2, 0.8, 0.3, 0.9, 0.0]
goal = [1.2, 0.6, -0.4, 1.5, -0.2, -0.9, 0.5]
for name, avoid in (("straight there", None), ("clear of singularities", "manipulability")):
    plan = sk.planning.time_optimal(arm, start, goal, avoid, time_weight=600.0, avoid_weight=10.0, acceleration=10.0)
    least = min(sk.indices.evaluate(arm, plan.q, "manipulability"))
    print(f"{name:22} {plan.status}, {plan.duration:.2f} s, least manipulability {least:.4f}")
