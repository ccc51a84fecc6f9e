"""five arms through their singularities by every method, in real time

Drives simulated arms as by a hand on the page of `sigmaik teleop`, each by every method, and says what the recordings
have: how near singularities they came, how fast the joints were, and which limits were broken.
"""
