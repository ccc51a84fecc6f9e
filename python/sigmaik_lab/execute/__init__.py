"""a time-optimal motion in physics, by computed torque and by velocity loops

Plans a time-optimal motion from one random configuration to another, and executes this motion in MuJoCo: by computed
torque that does not know the payload, by computed torque that knows the payload, and by the joints' velocity loops.
Prints tracking errors and the torques used. The last line on stdout is the last file. Needs the extra sim.
"""
