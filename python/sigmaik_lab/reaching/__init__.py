"""motions along a good geometry-aware index, and others

Motions between random configurations by several methods, with the indices of Petrović et al. averaged along them,
beside the paper's table 1, and what they cost in length, acceleration and time. The last line on stdout is the path
of the table as CSV.
"""
