"""drive an arm along a path by one method or several, and compare

Runs the closed loop, prints a table, and writes the time series, the table and a picture. Settings that are not given
come from the J-PARSE paper's experiments with the arm. The last line on stdout is the picture's path.
"""
