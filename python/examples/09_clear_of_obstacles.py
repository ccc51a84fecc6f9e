"""A servo that keeps clear of a table, a post that moves, and itself. The same as 09_clear_of_obstacles.cpp."""

import math

import sigmaik as sk

arm = sk.robots.load("ufactory_xarm7")
table = sk.Obstacle.half_space([0.0, 0.0, 0.05], [0.0, 0.0, 1.0], name="table", links=[arm.tip, "link6"])
post = sk.Obstacle.capsule([0.45, -0.3, 0.0], [0.45, -0.3, 0.6], 0.03, name="post")
collisions = sk.Collisions(arm, [table, post])
servo = sk.Servo(arm, collisions=collisions)
servo.reset([0.0, -0.4, 0.0, 0.9, 0.0, 1.3, 0.0])
target = servo.pose
target[2, 3] = 0.02  # below the table's top
least = 1.0
place = post.pose
for i in range(6000):
    speed = 0.1 * math.cos(i * 1e-3)  # m/s
    place[1, 3] += speed * 1e-3
    collisions.move(1, place, [0.0, speed, 0.0, 0.0, 0.0, 0.0])  # from any thread
    step = servo.update(target)
    least = min(least, step.clearance)
print(
    f"{len(collisions.capsules)} capsules, least clearance {1e3 * least:.1f} mm, at the end "
    f"{1e3 * step.clearance:.1f} mm from {collisions.body_names[step.nearest[1]]}"
)
assert least > 0.01 - 1e-9
