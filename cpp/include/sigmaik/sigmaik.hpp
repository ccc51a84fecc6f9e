#pragma once
/// \file sigmaik.hpp
/// sigmaik: a Cartesian command goes in, joint velocities come out, at and near singularities.
///
/// Start here. Each header needs only those above it.
///
/// Included here:
///
///     layout.hpp           SIGMAIK_SAME_LAYOUT: a program whose types have other sizes does not link
///     types.hpp            JointVector, Jacobian, Twist [v; ω], Pose: sizes without heap
///     error.hpp            Error: what set-up refuses
///     status.hpp           Status: what a real-time call did
///     chain.hpp            Chain: the arm, immutable; from URDF
///     pose.hpp             rotation_log, rotation_exp, pose_error
///     kinematics.hpp       update, jacobian_gradient: pose and Jacobian of an arm; the Jacobian's derivative
///     spectrum.hpp         Spectrum: singular value decomposition with a warm start
///     parameters.hpp       the parameters of a rule: name, range and words
///     rules/               JParse, DampedLeastSquares, …: what to do with one singular direction, one file a rule
///     rules.hpp            Rules, Method: the list of the rules, and one of them or a rule of one's own
///     task.hpp             Task: which rows of a twist, in which axes
///     velocity_solver.hpp  VelocitySolver: rule and posture → Solution
///     batch.hpp            solve_batch: many problems at once
///     limits.hpp           LimitTracker: position, velocity, acceleration and jerk limits → this cycle's bounds
///     least_squares.hpp    LeastSquares: equalities, bounds and inequalities, always with an answer
///     indices.hpp          IndexFunction: manipulability, condition number, least singular value, geometry-aware index
///     singularities.hpp    SingularSets: known singular sets of three arms, potentials, manipulability in closed form
///     avoidance.hpp        Avoidance: a posture velocity away from singularities
///     collisions.hpp       Collisions: an arm as capsules, Obstacle; what a servo keeps clear of
///     servo.hpp            Servo: pose or twist in, joint command out, each cycle
///     servo_batch.hpp      ServoBatch: many servos of one arm, a cycle of all of them in one call
///     target_stream.hpp    TargetStream: samples of a moving pose in, a smooth target out, each cycle
///     action_chunks.hpp    ActionChunks: chunks of a policy's actions in, a smooth target out, each cycle
///     analytic_ik.hpp      AnalyticIk: every posture of a pose, for six joints with a spherical wrist
///     position_ik.hpp      PositionIk: joint positions of a pose, any chain, inside position limits
///     dynamics.hpp         Dynamics: mass matrix, Coriolis, gravity, payload
///     computed_torque.hpp  ComputedTorque: joint torques along a planned motion
///     constrained_ik.hpp   ConstrainedIk: a pose exactly in part, the rest as limits allow; time scaling
///     values.hpp           save, load, same: values and states as bytes, for other processes
///
/// To include by name:
///
///     loop_state.hpp                LoopState: the states of a loop, and what leads from one to the next; LoopFault
///     servo_loop.hpp                ServoLoop: a servo in a thread of its own; stale commands stop the arm
///     kdl.hpp                       from_kdl, to_kdl: from and to KDL::Chain; the one header that includes KDL
///     planning/distance_field.hpp   DistanceField: signed distances to obstacles on a grid
///     planning/arm_spheres.hpp      ArmSpheres: an arm as spheres, from a URDF's shapes or along its links
///     planning/batch_cost.hpp       BatchCost: a cost of all support states at once, such as a user's own
///     planning/joint_cost.hpp       JointCost: a smooth cost of joint positions, for both planners
///     planning/costs.hpp            potentials, manipulability, geometry-aware index as costs; sums of costs
///     planning/collision_costs.hpp  costs of obstacles, the arm itself and joint limits; min_distance
///     planning/cost.hpp             Cost: a weighted sum of costs, made before the arm is known
///     planning/costs/known_sets.hpp the singular sets of the next two terms
///     planning/costs/potential.hpp  Potential: a term of Cost, high near singular sets
///     planning/costs/manipulability.hpp Manipulability, LogManipulability: terms
///     planning/costs/geometry_aware.hpp GeometryAware: a term, the geometry-aware index
///     planning/costs/collision.hpp  Collision, SelfCollision, JointLimits: terms
///     planning/clearance.hpp        Clearance: how near a motion comes to singular sets
///     planning/trajectory.hpp       Trajectory: a planned motion; sample, retime, save
///     planning/collision_check.hpp  CollisionCheck: obstacles that a motion must not touch
///     planning/time_optimal.hpp     TimeOptimal: motions within limits, away from configurations of high cost
///     planning/support_states.hpp   SupportPlanner: smooth motions along which a cost is low, by gradient or samples
///     planning/plan.hpp             time_optimal, gradient, stochastic: each planner in one call
///     planning/play.hpp             play: a trajectory through a servo
///     planning/cart.hpp             cart_law: the motion of a cart that carries an arm, clear of a cylinder
///     planning/cart_plane.hpp       plane_cart_law: the same with two linear axes
///     planning/cart_motion.hpp      CartMotion, PlaneCartMotion: motions of a cart with their measures
///
/// Set-up throws Error. Calls marked "real time" are noexcept, bounded, and touch neither heap nor lock.

#include <sigmaik/action_chunks.hpp>
#include <sigmaik/analytic_ik.hpp>
#include <sigmaik/avoidance.hpp>
#include <sigmaik/batch.hpp>
#include <sigmaik/chain.hpp>
#include <sigmaik/collisions.hpp>
#include <sigmaik/computed_torque.hpp>
#include <sigmaik/constrained_ik.hpp>
#include <sigmaik/dynamics.hpp>
#include <sigmaik/error.hpp>
#include <sigmaik/indices.hpp>
#include <sigmaik/kinematics.hpp>
#include <sigmaik/layout.hpp>
#include <sigmaik/least_squares.hpp>
#include <sigmaik/limits.hpp>
#include <sigmaik/parameters.hpp>
#include <sigmaik/pose.hpp>
#include <sigmaik/position_ik.hpp>
#include <sigmaik/rules.hpp>
#include <sigmaik/servo.hpp>
#include <sigmaik/servo_batch.hpp>
#include <sigmaik/singularities.hpp>
#include <sigmaik/spectrum.hpp>
#include <sigmaik/status.hpp>
#include <sigmaik/target_stream.hpp>
#include <sigmaik/task.hpp>
#include <sigmaik/types.hpp>
#include <sigmaik/values.hpp>
#include <sigmaik/velocity_solver.hpp>
