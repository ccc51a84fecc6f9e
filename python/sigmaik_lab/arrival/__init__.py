"""random targets: which the arm reaches, how fast, and whether it rests

Drives arms from random configurations to targets that rest: poses near the start, poses of any other configuration, or
poses out of reach. Compares the servo with its defaults with J-PARSE at a fixed threshold, or with other libraries'
servos. Prints a table of arrivals, times, rest, limits and cost, and writes it with a picture of the times. The last
line on stdout is the last file.
"""
