"""a target that moves, seen by a camera: errors, delay, jerk, events

An arm follows a target that moves, as a simulated camera sees it: late, noisy, some pictures without it, some wrong,
and none at all for a while. Every rule with the first mode, and every mode with the first rule, all limits on. Prints
tables of errors, delay, jerk and events, and writes time series, the tables and pictures. The last line on stdout is
the last file.
"""
