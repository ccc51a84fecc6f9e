"""Driving an arm by hand: a servo in a thread of its own, its commands, its settings, and recordings.

    session = sigmaik.teleop.Session("ufactory_xarm7")
    with session:                                  # starts the servo, and stops it
        session.start_recording("episode.part")    # on disk as it goes; without a file: in memory
        session.follow(target)                     # (4, 4); or session.twist([vx, vy, vz, wx, wy, wz])
        session.configure(method="dls")            # during the motion, without a jump
        session.stop()                             # latched: commands are refused until session.release()
        episode = session.stop_recording()
    episode.save("episode.npz")

`sigmaik teleop` shows a session on a page in the browser (`sigmaik.teleop.page`, extra `viewer`).
"""

from .episode import Episode
from .session import Session
from .settings import Settings

__all__ = ["Episode", "Session", "Settings"]
