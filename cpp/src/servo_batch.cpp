#include <sigmaik/servo_batch.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "message.hpp"
#include "worker_pool.hpp"

namespace sigmaik {
namespace {

using detail::require;
using Pose4 = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;

// Row b of (B, width), or the one row that stands for all.
std::span<const double> row_of(std::span<const double> rows, std::size_t b, std::size_t width) {
  return rows.size() == width ? rows : rows.subspan(b * width, width);
}

void check_rows(const char* what, std::span<const double> rows, std::size_t count, std::size_t width,
                std::span<const std::uint8_t> mask, const Chain& chain) {
  require(rows.size() == width || rows.size() == count * width, what, " has ", rows.size(), " entries; it needs ",
          width, ", a row for all, or ", count, " rows of ", width);
  for (std::size_t b = 0; b < count; ++b) {
    if (!mask.empty() && mask[b] == 0) continue;
    const std::span<const double> row = row_of(rows, b, width);
    for (std::size_t i = 0; i < width; ++i) {
      require(std::isfinite(row[i]), what, " of joint '", chain.joint_names()[i], "' in row ", b, " is not finite");
    }
  }
}

JointVector joints_of(std::span<const double> row) {
  return Eigen::Map<const Eigen::VectorXd>(row.data(), static_cast<Eigen::Index>(row.size()));
}

}  // namespace

struct ServoBatch::Parts {
  Parts(const Servo& prototype, std::size_t count, int threads)
      : servos(count, prototype),
        joints(static_cast<std::size_t>(prototype.chain().dof())),
        q(count * joints, std::numeric_limits<double>::quiet_NaN()),
        qdot(count * joints, 0.0),
        pose_error(count * 6, 0.0),
        achieved_twist(count * 6, 0.0),
        tips(count * 16, std::numeric_limits<double>::quiet_NaN()),
        status(count, static_cast<std::int8_t>(Status::BadInput)),
        pool(static_cast<int>(std::min(static_cast<std::size_t>(threads), count))) {}

  void put_tip(std::size_t b) noexcept { Eigen::Map<Pose4>(tips.data() + 16 * b) = servos[b].tip().matrix(); }

  void put(std::size_t b, const ServoStep& step) noexcept {
    const auto n = static_cast<Eigen::Index>(joints);
    Eigen::Map<Eigen::VectorXd>(q.data() + b * joints, n) = step.q;
    Eigen::Map<Eigen::VectorXd>(qdot.data() + b * joints, n) = step.qdot;
    Eigen::Map<Eigen::Matrix<double, 6, 1>>(pose_error.data() + 6 * b) = step.pose_error;
    Eigen::Map<Eigen::Matrix<double, 6, 1>>(achieved_twist.data() + 6 * b) = step.achieved_twist;
    status[b] = static_cast<std::int8_t>(step.status);
    put_tip(b);
  }

  // A cycle of all servos; cycle(servo, b) gives the step. Servos that never started stay as they are.
  template <typename Cycle>
  void run(const Cycle& cycle) noexcept {
    pool.run(servos.size(), [&](std::size_t begin, std::size_t end) {
      for (std::size_t b = begin; b < end; ++b) {
        if (servos[b].q().size() != 0) put(b, cycle(servos[b], b));
      }
    });
  }

  std::vector<Servo> servos;
  std::size_t joints, started = 0;
  std::vector<double> q, qdot, pose_error, achieved_twist, tips;
  std::vector<std::int8_t> status;
  detail::WorkerPool pool;
};

ServoBatch::ServoBatch(const Chain& chain, const Method& method, const ServoOptions& options, std::size_t size,
                       int threads) {
  require(size >= 1, "size = ", size, " must be at least 1");
  require(threads >= 1, "threads = ", threads, " must be at least 1");
  parts_ = std::make_unique<Parts>(Servo(chain, method, options), size, threads);
}
ServoBatch::ServoBatch(ServoBatch&& other) noexcept = default;
ServoBatch& ServoBatch::operator=(ServoBatch&& other) noexcept = default;
ServoBatch::~ServoBatch() = default;

void ServoBatch::reset(std::span<const double> q, std::span<const std::uint8_t> mask, std::span<const double> qdot) {
  Parts& p = *parts_;
  const std::size_t count = size(), n = p.joints;
  require(mask.empty() || mask.size() == count, "mask has ", mask.size(), " entries, the batch ", count, " servos");
  check_rows("q", q, count, n, mask, servo(0).chain());
  if (!qdot.empty()) check_rows("qdot", qdot, count, n, mask, servo(0).chain());
  for (std::size_t b = 0; b < count; ++b) {
    if (!mask.empty() && mask[b] == 0) continue;
    Servo& servo = p.servos[b];
    if (servo.q().size() == 0) ++p.started;
    servo.reset(joints_of(row_of(q, b, n)), qdot.empty() ? JointVector() : joints_of(row_of(qdot, b, n)));
    ServoStep start;
    start.q = servo.q();
    start.qdot = servo.qdot();
    start.status = Status::Holding;
    p.put(b, start);
  }
}

bool ServoBatch::update(std::span<const double> poses, std::span<const double> feedforward) noexcept {
  if (poses.size() != 16 * size() || (!feedforward.empty() && feedforward.size() != 6 * size())) return false;
  parts_->run([&](Servo& servo, std::size_t b) noexcept {
    Pose target;
    target.matrix() = Eigen::Map<const Pose4>(poses.data() + 16 * b);
    if (feedforward.empty()) return servo.update(target);
    return servo.update(target, Twist(Eigen::Map<const Eigen::Matrix<double, 6, 1>>(feedforward.data() + 6 * b)));
  });
  return true;
}

bool ServoBatch::update_twist(std::span<const double> twists, Frame frame) noexcept {
  if (twists.size() != 6 * size()) return false;
  parts_->run([&](Servo& servo, std::size_t b) noexcept {
    const Twist twist = Eigen::Map<const Eigen::Matrix<double, 6, 1>>(twists.data() + 6 * b);
    return frame == Frame::Base ? servo.update_twist(twist) : servo.update_twist(twist, frame, Eigen::Vector3d::Zero());
  });
  return true;
}

std::size_t ServoBatch::size() const noexcept { return parts_->servos.size(); }
int ServoBatch::threads() const noexcept { return static_cast<int>(parts_->pool.size()); }
std::size_t ServoBatch::started() const noexcept { return parts_->started; }
const Servo& ServoBatch::servo(std::size_t b) const noexcept { return parts_->servos[b]; }
std::span<double> ServoBatch::q() noexcept { return parts_->q; }
std::span<double> ServoBatch::qdot() noexcept { return parts_->qdot; }
std::span<std::int8_t> ServoBatch::status() noexcept { return parts_->status; }
std::span<double> ServoBatch::pose_error() noexcept { return parts_->pose_error; }
std::span<double> ServoBatch::achieved_twist() noexcept { return parts_->achieved_twist; }
std::span<double> ServoBatch::tips() noexcept { return parts_->tips; }

}  // namespace sigmaik
