"""solvers of positions near singularities: error, way of the joints, starts, cost

Solves positions of the tip with PositionIk, with iterations of our rules, and with other libraries' solvers, in the
four panels of a published comparison (arXiv 2604.13405): the error by the condition number of the target, the way of
the joints for a small step of the tip, starts near and far from the solution and outside the joint ranges, and the
time. Prints a table of each panel, and writes CSV and a picture. The last line on stdout is the last file.
"""
