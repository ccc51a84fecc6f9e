"""drive a KUKA arm by its axis-5 singularity, within limits

Two experiments on a KUKA KR 6 R900 (Schreiber, Otter, Hirzinger 1999): closed form against constrained least squares
with the position exact, without the error's rate (β = 0), with time scaling, and with time scaling and all six rows
exact. Prints tables, and writes the time series, the table and pictures. The last line on stdout is the overview
picture's path.
"""
