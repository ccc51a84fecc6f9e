"""a target that moves, seen by a camera: errors, delay, jerk, events

An arm follows a moving target that a simulated camera measures late and with noise; some pictures do not show the
target, some samples are wrong, and for a while there is no sample. Runs every rule with the first mode, and every mode
with the first rule, all limits on. Prints tables of errors, delay, jerk and events, and writes time series, the tables
and pictures. The last line on stdout is the last file.
"""
