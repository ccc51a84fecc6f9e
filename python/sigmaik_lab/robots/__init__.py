"""list the arms that are shipped, and their paths

Names for --robot, and for --path of `sigmaik reach`.
"""
