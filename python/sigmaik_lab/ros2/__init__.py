"""a ROS 2 node in place of MoveIt Servo: twists and poses in, commands out

Runs a node with the topics, services and parameters of MoveIt Servo around the servo loop. All parameters of the node
are ROS parameters: `sigmaik ros2 --robot franka_panda --ros-args -p method:=dls -p publish_period:=0.008`. The arm
rests until a command comes, and stops when commands are stale, when the joints are not where they should be, and when
the node ends.
"""
