"""learn to fetch a cup from the edge of reach: record, train, evaluate, show

An arm fetches a cup where the arm is singular and places the cup near the base, after the experiment of J-PARSE's
paper on learning from demonstration. `record` has a scripted demonstrator with the noise of a hand perform the task,
and writes the demonstrations as a data set.
"""
