"""an arm round a table, with the geometry-aware index and without

Plans motions of an iiwa from under a table to above the table by samples, with the geometry-aware index and without,
after Petrović et al., section 4.2. Distances are checked at ten times as many points as the planner uses. The last line
on stdout is the picture's path.
"""
