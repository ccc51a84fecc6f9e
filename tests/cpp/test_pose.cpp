// Rotations and poses: the logarithm from the smallest angle to a half turn, against long double.

#include <doctest/doctest.h>

#include <limits>
#include <numbers>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <sigmaik/pose.hpp>

#include "random.hpp"

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using sigmaik::Pose;
using sigmaik::Twist;
using test::Random;

constexpr double kPi = std::numbers::pi;
using LongMatrix = Eigen::Matrix<long double, 3, 3>;
using LongVector = Eigen::Matrix<long double, 3, 1>;

// Rodrigues in long double, rounded once.
Matrix3d exact_rotation(const Vector3d& axis, long double angle) {
  const LongVector k = axis.cast<long double>().normalized();
  LongMatrix cross;
  cross << 0.0L, -k[2], k[1], k[2], 0.0L, -k[0], -k[1], k[0], 0.0L;
  // 1 − cos without cancellation
  const long double half = std::sin(0.5L * angle);
  return (LongMatrix::Identity() + std::sin(angle) * cross + 2.0L * half * half * cross * cross).cast<double>();
}

Matrix3d half_turn(const Vector3d& axis) {  // exactly symmetric
  const Vector3d k = axis.normalized();
  return 2.0 * k * k.transpose() - Matrix3d::Identity();
}

std::vector<Vector3d> axes(Random& random) {
  std::vector<Vector3d> out;
  for (int x = -1; x <= 1; ++x) {
    for (int y = -1; y <= 1; ++y) {
      for (int z = -1; z <= 1; ++z) {
        if (x != 0 || y != 0 || z != 0) out.push_back(Vector3d(x, y, z).normalized());
      }
    }
  }
  for (int i = 0; i < 200; ++i) {
    Vector3d axis = random.unit(3);
    if (i % 3 == 0) axis[random.integer(0, 2)] *= random.decades(-17.0, -1.0);  // close to a plane
    if (i % 5 == 0) axis[random.integer(0, 2)] *= random.decades(-17.0, -1.0);
    out.push_back(axis.normalized());
  }
  return out;
}

}  // namespace

TEST_CASE("logarithm: every angle about every axis") {
  Random random(1);
  std::vector<double> angles{1e-300, 1e-200,    1e-16,           1e-12, 1e-9, 1e-8,       1e-6,       1e-3,
                             0.1,    0.5 * kPi, 2.0 * kPi / 3.0, 3.0,   3.1,  kPi - 1e-3, kPi - 1e-6, kPi - 1e-8};
  for (int i = 0; i < 40; ++i) angles.push_back(random.uniform(0.0, 3.14));
  for (const Vector3d& axis : axes(random)) {
    for (const double angle : angles) {
      CAPTURE(axis.transpose());
      CAPTURE(angle);
      const Vector3d log = sigmaik::rotation_log(exact_rotation(axis, angle));
      // The nine entries are rounded, so no vector is closer than that.
      CHECK((log - angle * axis).norm() < 4e-15);
      if (angle <= 1e-9) CHECK((log - angle * axis).cwiseAbs().maxCoeff() < 2e-15 * angle);
    }
  }
}

TEST_CASE("logarithm: so close to a half turn that rounding may choose the sign of the axis") {
  Random random(2);
  for (const Vector3d& axis : axes(random)) {
    for (const double short_of : {1e-10, 1e-13, 1e-15, 1e-16, 1e-17, 0.0, -1e-16, -1e-13}) {
      CAPTURE(axis.transpose());
      CAPTURE(short_of);
      const Vector3d log = sigmaik::rotation_log(exact_rotation(axis, std::numbers::pi_v<long double> - short_of));
      CHECK(log.norm() <= kPi * (1.0 + 1e-15));
      CHECK(log.norm() == doctest::Approx(kPi - std::abs(short_of)).epsilon(1e-14));
      CHECK(std::min((log - kPi * axis).norm(), (log + kPi * axis).norm()) < 1e-9);
    }
  }
}

TEST_CASE("logarithm: a half turn has one answer, whose first entry that is not zero is positive") {
  Random random(3);
  for (const Vector3d& axis : axes(random)) {
    CAPTURE(axis.transpose());
    const Vector3d log = sigmaik::rotation_log(half_turn(axis));
    CHECK(std::abs(log.norm() - kPi) < 1e-14);
    CHECK(log.cross(axis).norm() < 1e-13);
    CHECK(log == sigmaik::rotation_log(half_turn(-axis)));
    for (int i = 0; i < 3; ++i) {
      if (std::abs(log[i]) < kPi * 1e-9) continue;  // zero but for rounding
      CHECK(log[i] > 0.0);
      break;
    }
  }
  CHECK(sigmaik::rotation_log(half_turn(Vector3d::UnitX())) == Vector3d(kPi, 0.0, 0.0));
  CHECK(sigmaik::rotation_log(half_turn(Vector3d::UnitY())) == Vector3d(0.0, kPi, 0.0));
  CHECK(sigmaik::rotation_log(half_turn(Vector3d::UnitZ())) == Vector3d(0.0, 0.0, kPi));
}

TEST_CASE("logarithm of the identity is exactly zero") {
  CHECK(sigmaik::rotation_log(Matrix3d::Identity()) == Vector3d::Zero());
  Random random(4);
  for (int i = 0; i < 1000; ++i) {
    const Matrix3d r = random.rotation();
    CHECK(sigmaik::rotation_log(r * r.transpose()).norm() < 1e-15);
  }
}

TEST_CASE("logarithm and exponential undo each other") {
  Random random(5);
  for (int i = 0; i < 5000; ++i) {
    const Vector3d vector = random.unit(3) * (i % 2 == 0 ? random.uniform(0.0, 3.14159) : random.decades(-300.0, 0.0));
    CAPTURE(vector.transpose());
    const Matrix3d r = sigmaik::rotation_exp(vector);
    CHECK((r.transpose() * r - Matrix3d::Identity()).cwiseAbs().maxCoeff() < 4e-15);
    const double error = (sigmaik::rotation_log(r) - vector).cwiseAbs().maxCoeff();
    CHECK(error < 1e-14);
    if (vector.norm() < 1e-6) CHECK(error < 1e-14 * vector.cwiseAbs().maxCoeff());
    CHECK((r - exact_rotation(vector, static_cast<long double>(vector.norm()))).cwiseAbs().maxCoeff() < 2e-15);
  }
}

TEST_CASE("exponential of several turns and of subnormal vectors is a rotation") {
  Random random(6);
  for (int i = 0; i < 1000; ++i) {
    const Vector3d vector = random.unit(3) * (i % 2 == 0 ? random.decades(0.5, 307.0) : random.decades(-322.0, -290.0));
    CAPTURE(vector.transpose());
    const Matrix3d r = sigmaik::rotation_exp(vector);
    CHECK(r.allFinite());
    CHECK((r.transpose() * r - Matrix3d::Identity()).cwiseAbs().maxCoeff() < 1e-14);
  }
  CHECK(sigmaik::rotation_exp(Vector3d::Zero()) == Matrix3d::Identity());
}

TEST_CASE("rates: of a rotation from that of its vector, against differences, and back") {
  Random random(9);
  for (int i = 0; i < 5000; ++i) {
    const double angle = i % 3 == 0 ? random.decades(-12.0, -1.0) : random.uniform(0.0, 6.0);
    const Vector3d vector = angle * random.unit(3), rate = random.vector(3);
    CAPTURE(vector.transpose());
    const Vector3d omega = sigmaik::rotation_exp_rate(vector, rate);
    const double h = 1e-5;
    const Matrix3d ahead = sigmaik::rotation_exp(vector + h * rate), behind = sigmaik::rotation_exp(vector - h * rate);
    CHECK((sigmaik::rotation_log(ahead * behind.transpose()) / (2.0 * h) - omega).norm() < 1e-9 * (1.0 + rate.norm()));
    CHECK((sigmaik::rotation_log_rate(vector, omega) - rate).norm() < 1e-11 * (1.0 + rate.norm()));
  }
}

TEST_CASE("pose error takes the one pose to the other") {
  Random random(7);
  for (int i = 0; i < 3000; ++i) {
    const Pose current = random.pose(), target = random.pose();
    const Twist error = sigmaik::pose_error(current, target);
    CHECK((current.translation() + error.head<3>() - target.translation()).norm() < 1e-15);
    const Matrix3d turned = sigmaik::rotation_exp(error.tail<3>()) * current.linear();
    CHECK((turned - target.linear()).cwiseAbs().maxCoeff() < 5e-15);
    CHECK(error.tail<3>().norm() <= kPi * (1.0 + 1e-15));
    const Twist back = sigmaik::pose_error(target, current);
    CHECK((error + back).norm() < 1e-13);
    CHECK(sigmaik::pose_error(current, current).norm() < 1e-15);
    // The same error, seen from a base that is turned and moved.
    const Pose base = random.pose();
    const Twist seen = sigmaik::pose_error(base * current, base * target);
    CHECK((seen.head<3>() - base.linear() * error.head<3>()).norm() < 1e-14);
    CHECK((seen.tail<3>() - base.linear() * error.tail<3>()).norm() < 1e-13);
  }
}

TEST_CASE("what is a pose") {
  Random random(8);
  const double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 500; ++i) {
    const Eigen::Matrix4d good = random.pose().matrix();
    CHECK(sigmaik::is_pose(good));
    for (const double wrong : {nan, infinity, -infinity}) {
      Eigen::Matrix4d bad = good;
      bad(random.integer(0, 3), random.integer(0, 3)) = wrong;
      CHECK_FALSE(sigmaik::is_pose(bad));
    }
    Eigen::Matrix4d bad = good;
    bad.col(random.integer(0, 2)) *= -1.0;  // a reflection
    CHECK_FALSE(sigmaik::is_pose(bad));
    bad = good;
    bad.topLeftCorner<3, 3>() *= 1.0 + 1e-3;
    CHECK_FALSE(sigmaik::is_pose(bad));
    bad = good;
    bad(3, random.integer(0, 3)) += 1e-9;
    CHECK_FALSE(sigmaik::is_pose(bad));
    Eigen::Matrix4d near = good;  // as single precision leaves it
    near = near.cast<float>().cast<double>();
    CHECK(sigmaik::is_pose(near));
  }
  CHECK_FALSE(sigmaik::is_pose(Eigen::Matrix4d::Zero()));
}

TEST_CASE("a matrix that is a rotation but for rounding becomes the nearest rotation") {
  Random random(9);
  int rough = 0;
  for (int i = 0; i < 2000; ++i) {
    const sigmaik::Pose good = random.pose();
    Eigen::Matrix4d matrix = good.matrix();
    const double size = random.decades(-12.0, -3.6);
    switch (i % 4) {
      case 0: matrix = (matrix * 1e5).array().round().matrix() * 1e-5; break;               // five digits
      case 1: matrix.topLeftCorner<3, 3>() *= 1.0 + 2.4e-4 * random.uniform(-1, 1); break;  // of a quaternion
      case 2: matrix.topLeftCorner<3, 3>() += size * random.matrix(3, 3).cwiseMax(-2.0).cwiseMin(2.0); break;
      default: {
        Eigen::Matrix4f product = Eigen::Matrix4f::Identity();
        for (int k = 0; k < 50; ++k) product = product * random.pose().matrix().cast<float>();
        matrix.topLeftCorner<3, 3>() = product.topLeftCorner<3, 3>().cast<double>();
      }
    }
    if (!sigmaik::is_pose(matrix)) {
      CHECK(i % 4 == 2);  // nine errors of the same sign
      continue;
    }
    sigmaik::Pose given;
    given.matrix() = matrix;
    const sigmaik::Pose pose = sigmaik::nearest_pose(given);
    const Eigen::Matrix3d r = pose.linear();
    CHECK((r.transpose() * r - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < 1e-14);
    CHECK(r.determinant() > 0.0);
    CHECK(pose.translation() == given.translation());
    Eigen::Matrix3d polar = given.linear();  // by Higham's iteration, which is another one
    for (int k = 0; k < 8; ++k) polar = 0.5 * (polar + Eigen::Matrix3d(polar.inverse().transpose()));
    CHECK((r - polar).cwiseAbs().maxCoeff() < 1e-14);
    const double change = (r - given.linear()).cwiseAbs().maxCoeff();
    if (change > 1e-8) CHECK(sigmaik::is_rough(given));
    if (change < 1e-10) CHECK_FALSE(sigmaik::is_rough(given));
    rough += sigmaik::is_rough(given) ? 1 : 0;
    CHECK(sigmaik::nearest_pose(pose).matrix() == pose.matrix());
  }
  CHECK(rough > 1000);
}

TEST_CASE("a quaternion whose length is off by 1e-4 gives a pose, by the homogeneous formula and by the usual one") {
  Random random(19);
  for (int i = 0; i < 5000; ++i) {
    const Eigen::Vector3d v = random.unit(4).head<3>();
    Eigen::Quaterniond q(random.pose().linear());
    q.coeffs() *= 1.0 + 1e-4 * (i % 2 == 0 ? 1.0 : random.uniform(-1.0, 1.0));
    const double x = q.x(), y = q.y(), z = q.z(), w = q.w();
    Eigen::Matrix4d usual = Eigen::Matrix4d::Identity(), homogeneous = usual;
    usual.topLeftCorner<3, 3>() << 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),  //
        2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),                             //
        2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y);
    homogeneous.topLeftCorner<3, 3>() = usual.topLeftCorner<3, 3>();
    homogeneous.topLeftCorner<3, 3>().diagonal().array() += q.squaredNorm() - 1.0;
    usual.topRightCorner<3, 1>() = v;
    CHECK(sigmaik::is_pose(usual));
    CHECK(sigmaik::is_pose(homogeneous));
  }
}
