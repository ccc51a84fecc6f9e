"""The methods that every test of "each method" goes through. A new rule joins by being in sk.methods.ALL."""

import sigmaik as sk

#: Every rule with its default parameters, and the other modes of the rules.
METHODS = [
    *(sk.methods.parse(name) for name in sk.methods.ALL),
    sk.AdaptiveDampedLeastSquares("manipulability"),
    sk.AdaptiveDampedLeastSquares("smallest_singular_value"),
    sk.JParse(0.2, 2.0, 0.5),
    sk.JParse(0.2, 2.0, 0.5, continuous=False),
]
