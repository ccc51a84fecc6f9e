"""what joint limits cost, and what breaks without them

Drives an arm beyond its reach, beyond its joint limits, and by random twists, with its limits held in three ways,
clamped joint by joint, and not at all. Prints tables, and writes their figures as CSV, pictures, and the time series if
asked. The last line on stdout is the CSV file's path.
"""
