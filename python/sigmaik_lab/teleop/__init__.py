"""drive an arm from a page in the browser, through its singularities

Drives a simulated arm from a page in the browser: drag the gizmo, hold a button, tap a key, or use a gamepad or a
SpaceMouse. The servo runs in a thread of its own; rule, gains, limits and task can change during the motion; every
cycle can be recorded. The arm stops when the browser that drives the arm is gone.
"""
