#pragma once
/// \file sigmaik.hpp
/// sigmaik: a Cartesian command goes in, joint velocities come out, at and near singularities.
///
/// Start here. Each header needs only those above it.
///
///     types.hpp            JointVector, Jacobian, Twist [v; ω], Pose; sizes without heap
///     status.hpp           Status: what a real-time call did        error.hpp   Error: what set-up refuses
///     chain.hpp            Chain: the arm, immutable; from URDF     kdl.hpp     from and to KDL::Chain (not included)
///     pose.hpp             rotation_log, rotation_exp, pose_error
///     kinematics.hpp       update(chain, q, state): pose and Jacobian; jacobian_gradient
///     spectrum.hpp         Spectrum: singular value decomposition with a warm start
///     inverse.hpp          JParse, DampedLeastSquares, …: one rule per singular direction
///     task.hpp             Task: which rows of a twist, in which axes
///     velocity_solver.hpp  VelocitySolver: rule and posture → Solution
///     batch.hpp            solve_batch: many at once
///     limits.hpp           LimitTracker: position, velocity, acceleration and jerk limits → this cycle's bounds
///     least_squares.hpp    LeastSquares: equalities, bounds and inequalities, always with an answer
///     indices.hpp          manipulability, condition number, smallest singular value, geometry-aware index; gradients
///     singularities.hpp    SingularSets: known singular sets of three arms, potentials, manipulability in closed form
///     avoidance.hpp        Avoidance: a posture velocity away from singularities
///     servo.hpp            Servo: pose or twist in, joint command out, each cycle
///     servo_loop.hpp       ServoLoop: a servo in a thread of its own; stale commands stop the arm (not included)
///     target_stream.hpp    TargetStream: samples of a moving pose in, a smooth target out, each cycle
///     analytic_ik.hpp      AnalyticIk: every posture of a pose, for six joints with a spherical wrist
///     dynamics.hpp         Dynamics: mass matrix, Coriolis, gravity, payload, by KDL (not included)
///     computed_torque.hpp  ComputedTorque: joint torques along a planned motion (not included)
///     constrained_ik.hpp   ConstrainedIk: a pose exactly in part, the rest as limits allow; time scaling (not
///     included) planning/time_optimal.hpp  TimeOptimal: motions within limits, away from what a cost marks (not
///     included) planning/support_states.hpp  SupportPlanner: smooth motions along which a cost is low, by gradient or
///     samples planning/batch_cost.hpp    BatchCost: a cost of all support states at once, such as a user's own (not
///     included) planning/costs.hpp         costs for both: potentials, manipulability, geometry-aware index (not
///     included) planning/cart.hpp          cart_law: where to drive the cart of a cart-mounted arm, clear of a
///     cylinder (not included) planning/cart_plane.hpp    plane_cart_law: the same with two linear axes (not included)
///     planning/distance_field.hpp   DistanceField: signed distances to obstacles on a grid (not included)
///     planning/arm_spheres.hpp      ArmSpheres: an arm as spheres, from a URDF's shapes or along its links (not
///     included) planning/collision_costs.hpp  costs of obstacles, the arm itself, joint limits; min_distance (not
///     included)
///
/// Set-up throws Error. Calls marked "real time" are noexcept, bounded, and touch neither heap nor lock.

#include <sigmaik/analytic_ik.hpp>
#include <sigmaik/avoidance.hpp>
#include <sigmaik/batch.hpp>
#include <sigmaik/chain.hpp>
#include <sigmaik/error.hpp>
#include <sigmaik/indices.hpp>
#include <sigmaik/inverse.hpp>
#include <sigmaik/kinematics.hpp>
#include <sigmaik/least_squares.hpp>
#include <sigmaik/limits.hpp>
#include <sigmaik/pose.hpp>
#include <sigmaik/servo.hpp>
#include <sigmaik/singularities.hpp>
#include <sigmaik/spectrum.hpp>
#include <sigmaik/status.hpp>
#include <sigmaik/target_stream.hpp>
#include <sigmaik/task.hpp>
#include <sigmaik/types.hpp>
#include <sigmaik/velocity_solver.hpp>
