#pragma once
/// \file values.hpp
/// Values and states as bytes: to compare them, to keep them, and to send them to another process.
///
/// A *value* is an answer or a model, such as a ServoStep or a Chain. save() writes a value, and load() makes the same
/// value again. A *state* is what an object such as a Servo remembers of the calls before. save_state() writes a state,
/// and load_state() puts the state into an object that was made with the same arguments; this object then continues
/// bit by bit as the first object does:
///
///     const std::string bytes = save_state(servo);
///     Servo other(load<Chain>(save(servo.chain())), servo.method(), servo.options());
///     load_state(other, bytes);
///
/// The bytes have the same meaning on every machine. They begin with a version, a fingerprint of the members of the
/// type, and a checksum. Bytes of another version, of other members, cut off or changed are refused. Bytes that were
/// made with malice are read without access beyond any memory, but may hold a nonsensical motion.
///
/// The members of each type are listed once (cpp/src/members.hpp), in the order of the struct; the compiler refuses a
/// list whose sizes do not add up to that of the type.

#include <cstddef>
#include <string>
#include <string_view>

#include <sigmaik/analytic_ik.hpp>
#include <sigmaik/chain.hpp>
#include <sigmaik/computed_torque.hpp>
#include <sigmaik/constrained_ik.hpp>
#include <sigmaik/least_squares.hpp>
#include <sigmaik/position_ik.hpp>
#include <sigmaik/servo.hpp>
#include <sigmaik/spectrum.hpp>
#include <sigmaik/target_stream.hpp>
#include <sigmaik/velocity_solver.hpp>

namespace sigmaik {

/// The version of the bytes that save() and save_state() write.
inline constexpr unsigned kValuesVersion = 1;

/// The bytes of a value. For Chain, JointLimits, Inertia, Segment, ServoStep, ConstrainedIkStep, ComputedTorqueStep,
/// Solution, Spectrum, LeastSquaresSolution, AnalyticBranch, PositionIkResult, PositionIkBranch, Target, SampleCounts.
template <typename Value>
std::string save(const Value& value);

/// The value of these bytes.
/// \throws Error where the bytes are not those of such a value, or of another version
template <typename Value>
Value load(std::string_view bytes);

/// Whether two values are the same, member by member. NaN is the same as NaN, and −0 as 0.
template <typename Value>
bool same(const Value& one, const Value& other);

/// A hash of a value; values that are the same() have the same hash.
template <typename Value>
std::size_t hash(const Value& value);

/// The bytes of a state. For Servo, ConstrainedIk, VelocitySolver, TargetStream.
template <typename Object>
std::string save_state(const Object& object);

/// Puts a state into an object that was made with the same arguments.
/// \throws Error as load(), and where the state is of an arm with another number of joints; the object is unchanged
template <typename Object>
void load_state(Object& object, std::string_view bytes);

/// Whether two objects that were made with the same arguments remember the same.
template <typename Object>
bool same_state(const Object& one, const Object& other);

}  // namespace sigmaik
