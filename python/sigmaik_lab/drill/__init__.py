"""five arms through their singularities by every method, in real time

Drives simulated arms as a user does on the page of `sigmaik teleop`, each arm by every method. Prints figures of the
recordings: how near the arms came to singularities, how fast the joints were, and how many limits were broken.
"""
