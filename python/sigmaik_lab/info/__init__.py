"""an arm's joints, limits, reach and singular values

Joints, limits, reach, and the pose and singular values at a configuration.
"""
