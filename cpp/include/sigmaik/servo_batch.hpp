#pragma once
/// \file servo_batch.hpp
/// Many servos of one arm, a cycle of all of them in one call: for learning and for simulation.

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include <sigmaik/layout.hpp>
#include <sigmaik/servo.hpp>

namespace sigmaik {

/// B servos of one chain, rule and options. Servo b does, to the last bit, what a Servo alone would do with the same
/// calls; neither B nor the number of threads changes an answer. Every servo holds all limits (servo.hpp).
///
/// Arrays are in C order, a row for each servo. The answers stand in arrays that the batch owns and that each cycle
/// overwrites: they do not move while the batch lives. A batch is for one caller at a time.
///
///     ServoBatch batch(chain, JParse{}, {.dt = 1e-2}, 1024, 2);
///     batch.reset(home);               // (n,) for all, or (B, n)
///     batch.update(poses);             // (B, 4, 4)
///     send(batch.q(), batch.status());
class ServoBatch {
 public:
  /// \param size B ≥ 1
  /// \param threads ≥ 1, the most that work at once, the caller included; never more than the machine has cores. The
  ///     threads live as long as the batch, and worker w of W has the servos from B·w/W on.
  /// \throws Error where an option is out of its range
  ServoBatch(const Chain& chain, const Method& method, const ServoOptions& options, std::size_t size, int threads = 1);
  /// Moves the arrays along: spans of them stay valid.
  ServoBatch(ServoBatch&& other) noexcept;
  /// Likewise.
  ServoBatch& operator=(ServoBatch&& other) noexcept;
  ~ServoBatch();

  /// Starts servos, or starts them again, as Servo::reset(). Their rows of q() and qdot() become the start, and their
  /// status Holding. Checks everything first: where something is refused, nothing has changed.
  /// \param q (n,) for every servo, or (B, n); rows that the mask leaves out are not read
  /// \param mask (B,) non-zero: this servo; empty: all
  /// \param qdot (n,) or (B, n): how the arms move now; empty: they rest
  /// \throws Error where a size is wrong or an entry that is read is not finite
  void reset(std::span<const double> q, std::span<const std::uint8_t> mask = {}, std::span<const double> qdot = {});

  /// A cycle of every servo towards a pose of the tip in base, as Servo::update(). No heap; with one thread real time,
  /// with more of them the call waits for the slowest.
  ///
  /// A row that is not a pose stops its own servo (BadInput) and no other. A servo that was never reset has BadInput,
  /// no velocity, and NaN for q.
  /// \param poses (B, 4, 4)
  /// \param feedforward (B, 6) twists [v; ω] of targets that move, base axes, at the target's origin; empty: none
  /// \return false, with nothing done, where a size is wrong
  bool update(std::span<const double> poses, std::span<const double> feedforward = {}) noexcept;

  /// A cycle of every servo along a twist (B, 6) [v; ω] of the tip's origin, as Servo::update_twist().
  /// \param frame the axes of the twists
  /// \return false, with nothing done, where the size is wrong
  bool update_twist(std::span<const double> twists, Frame frame = Frame::Base) noexcept;

  /// B.
  std::size_t size() const noexcept;
  /// Threads that work at once, the caller included.
  int threads() const noexcept;
  /// Servos that were reset at least once.
  std::size_t started() const noexcept;
  /// Servo b < size(), to read.
  const Servo& servo(std::size_t b) const noexcept;

  // What a caller writes into these arrays moves no servo.

  /// (B, n) position commands [rad or m]; NaN before the first reset.
  std::span<double> q() noexcept;
  /// (B, n) velocity commands over the last dt [rad/s or m/s].
  std::span<double> qdot() noexcept;
  /// (B,) a Status for each servo.
  std::span<std::int8_t> status() noexcept;
  /// (B, 6) [m, rad] target minus tip before the cycle; zero for twists, and where the input is refused.
  std::span<double> pose_error() noexcept;
  /// (B, 6) J q̇ [m/s, rad/s].
  std::span<double> achieved_twist() noexcept;
  /// (B, 4, 4) the tips in base, at q().
  std::span<double> tips() noexcept;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

SIGMAIK_SAME_LAYOUT(ServoBatch);

}  // namespace sigmaik
