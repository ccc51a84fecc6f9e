"""random motions, clear of singularities or not: what it costs and brings

Time-optimal motions between random pairs of configurations, by three objectives, with the metrics of Beck et al. (2022)
beside the paper's. Writes a line for each sample as it comes: a study that is called again with the same options goes
on where it stopped. The last line on stdout is the last arm's file.
"""
