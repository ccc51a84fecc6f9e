"""A rule of one's own, in numpy: what to do with one singular direction. The C++ library runs such a rule in its solver
and servo, see 08_own_rule.cpp."""

import numpy as np

import sigmaik as sk

THRESHOLD = 0.05


def straight_to_zero(sigma):
    """1/σ down to a threshold, and from there on along a straight line through zero."""
    return 1.0 / sigma if sigma > THRESHOLD else sigma / THRESHOLD**2


arm = sk.robots.load("ufactory_xarm7")
spectrum = sk.Spectrum()
twist = np.array([0.1, 0, 0.1, 0, 0, 0])
for bend in (0.4, 0.1, 0.02, 0.0):  # towards the arm stretched out
    U, sigma, V = spectrum.decompose(arm.jacobian(np.full(arm.dof, bend)))
    qdot = V @ ([straight_to_zero(s) for s in sigma] * (U.T @ twist))
    print(f"smallest singular value {sigma[-1]:.4f}, fastest joint {np.abs(qdot).max():.4f} rad/s")
