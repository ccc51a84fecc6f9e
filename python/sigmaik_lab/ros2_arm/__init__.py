"""a simulated arm as a ROS 2 node: joint commands in, /joint_states out

Runs an arm in MuJoCo that follows the commands of `sigmaik ros2` (or of any node that publishes
trajectory_msgs/JointTrajectory), and publishes /joint_states and /robot_description. Without commands the arm stops.
"""
