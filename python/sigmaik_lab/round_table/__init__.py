"""an arm round a table, with the geometry-aware index and without

An iiwa from under a table to above it, planned by samples, with the geometry-aware index and without, after Petrović et
al., section 4.2. Distances are checked at ten times as many points as the planner looks at. The last line on stdout is
the picture's path.
"""
