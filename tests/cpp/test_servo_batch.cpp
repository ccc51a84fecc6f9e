// A ServoBatch is a row of single servos, to the last bit, whatever its size and its threads.

#include <doctest/doctest.h>

#include <limits>
#include <memory>
#include <string>
#include <vector>

#include <sigmaik/error.hpp>
#include <sigmaik/servo_batch.hpp>

#include "heap.hpp"
#include "methods.hpp"
#include "random.hpp"

namespace {

using namespace sigmaik;
using test::Random;
using Rows = std::vector<double>;
using Pose4 = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

Chain arm() { return Chain::from_urdf(std::string(SIGMAIK_ROBOTS_DIR) + "/ufactory_xarm7.urdf"); }

JointVector home() {
  JointVector q(7);
  q << 0.0, -0.35, 0.2, 1.05, 0.1, 1.4, 0.0;
  return q;
}

Rows starts(Random& random, std::size_t count) {
  Rows rows;
  for (std::size_t b = 0; b < count; ++b) {
    for (int i = 0; i < 7; ++i) rows.push_back(home()[i] + random.uniform(-0.3, 0.3));
  }
  return rows;
}

// Poses about the arm's own, and some out of reach.
Rows targets(Random& random, std::size_t count) {
  Rows rows(count * 16);
  for (std::size_t b = 0; b < count; ++b) {
    Pose pose = random.pose(random.chance(0.2) ? 2.0 : 0.6);
    Eigen::Map<Pose4>(rows.data() + 16 * b) = pose.matrix();
  }
  return rows;
}

Rows twists(Random& random, std::size_t count) {
  Rows rows;
  for (std::size_t i = 0; i < 6 * count; ++i) rows.push_back(random.uniform(-0.5, 0.5));
  return rows;
}

// The same calls on single servos.
struct Singles {
  Singles(const Method& method, const ServoOptions& options, std::size_t count)
      : servos(count, Servo(arm(), method, options)), steps(count) {}
  void reset(const Rows& q) {
    for (std::size_t b = 0; b < servos.size(); ++b) {
      servos[b].reset(Eigen::Map<const Eigen::VectorXd>(q.data() + 7 * b, 7));
    }
  }
  void update(const Rows& poses) {
    for (std::size_t b = 0; b < servos.size(); ++b) {
      Pose target;
      target.matrix() = Eigen::Map<const Pose4>(poses.data() + 16 * b);
      steps[b] = servos[b].update(target);
    }
  }
  void update_twist(const Rows& rows, Frame frame) {
    for (std::size_t b = 0; b < servos.size(); ++b) {
      const Twist twist = Eigen::Map<const Eigen::Matrix<double, 6, 1>>(rows.data() + 6 * b);
      steps[b] = frame == Frame::Base ? servos[b].update_twist(twist)
                                      : servos[b].update_twist(twist, frame, Eigen::Vector3d::Zero());
    }
  }
  bool same(ServoBatch& batch) const {
    bool equal = true;
    for (std::size_t b = 0; b < servos.size(); ++b) {
      for (int i = 0; i < 7; ++i) {
        const std::size_t at = 7 * b + static_cast<std::size_t>(i);
        equal = equal && batch.q()[at] == steps[b].q[i] && batch.qdot()[at] == steps[b].qdot[i];
      }
      for (int i = 0; i < 6; ++i) {
        const std::size_t at = 6 * b + static_cast<std::size_t>(i);
        equal = equal && batch.pose_error()[at] == steps[b].pose_error[i];
        equal = equal && batch.achieved_twist()[at] == steps[b].achieved_twist[i];
      }
      equal = equal && batch.status()[b] == static_cast<std::int8_t>(steps[b].status);
      equal = equal && Eigen::Map<const Pose4>(batch.tips().data() + 16 * b) == servos[b].tip().matrix();
    }
    return equal;
  }
  std::vector<Servo> servos;
  std::vector<ServoStep> steps;
};

}  // namespace

TEST_CASE("bit for bit single servos: poses, twists, any number of servos and threads, every rule") {
  for (const std::size_t count : {1u, 2u, 5u, 17u}) {
    for (const int threads : {1, 2, 3, 100}) {
      for (const Method& method : test::library_methods()) {
        CAPTURE(count);
        CAPTURE(threads);
        CAPTURE(name(method));
        Random random(7);
        const ServoOptions options{.dt = 1e-2, .posture_gain = 1.0};
        ServoBatch batch(arm(), method, options, count, threads);
        Singles singles(method, options, count);
        const Rows start = starts(random, count);
        batch.reset(start);
        singles.reset(start);
        bool equal = true;
        for (int cycle = 0; cycle < 20; ++cycle) {
          const Rows rows = targets(random, count);
          REQUIRE(batch.update(rows));
          singles.update(rows);
          equal = equal && singles.same(batch);
        }
        for (const Frame frame : {Frame::Base, Frame::Tool}) {
          const Rows rows = twists(random, count);
          REQUIRE(batch.update_twist(rows, frame));
          singles.update_twist(rows, frame);
          equal = equal && singles.same(batch);
        }
        CHECK(equal);
      }
    }
  }
}

TEST_CASE("the mask starts the servos that it names, and no others") {
  Random random(1);
  ServoBatch batch(arm(), JParse{}, {.dt = 1e-2}, 4, 2);
  CHECK(batch.started() == 0);
  Rows q = starts(random, 4);
  const std::vector<std::uint8_t> first{1, 0, 1, 0}, second{0, 1, 0, 0};
  for (std::size_t i = 7; i < 14; ++i) q[i] = kNan;  // a row that is not read
  batch.reset(q, first);
  CHECK(batch.started() == 2);
  CHECK(batch.q()[0] == q[0]);
  CHECK(std::isnan(batch.q()[7]));
  CHECK(batch.status()[0] == static_cast<std::int8_t>(Status::Holding));

  const Rows rows = targets(random, 4);
  REQUIRE(batch.update(rows));
  CHECK(batch.status()[0] != static_cast<std::int8_t>(Status::BadInput));
  CHECK(batch.status()[1] == static_cast<std::int8_t>(Status::BadInput));  // never started
  CHECK(std::isnan(batch.q()[7]));
  CHECK(batch.qdot()[7] == 0.0);

  const Rows before(batch.q().begin(), batch.q().end());
  const JointVector one = home();
  batch.reset({one.data(), 7}, second);  // one row for all that the mask names
  for (std::size_t i = 0; i < 7; ++i) {
    CHECK(batch.q()[7 + i] == one[static_cast<Eigen::Index>(i)]);
    CHECK(batch.q()[i] == before[i]);
  }
}

TEST_CASE("a bad row stops its own servo and changes no other") {
  Random random(2);
  const ServoOptions options{.dt = 1e-2};
  ServoBatch batch(arm(), JParse{}, options, 6, 2), clean(arm(), JParse{}, options, 6, 1);
  const Rows start = starts(random, 6);
  batch.reset(start);
  clean.reset(start);
  const Rows rows = targets(random, 6);
  for (int cycle = 0; cycle < 30; ++cycle) {
    REQUIRE(batch.update(rows));
    REQUIRE(clean.update(rows));
  }
  for (const double bad : {kNan, std::numeric_limits<double>::infinity(), 3.0}) {
    Rows broken = rows;
    broken[16 * 2 + 5] = bad;
    for (int cycle = 0; cycle < 200; ++cycle) {
      REQUIRE(batch.update(broken));
      REQUIRE(clean.update(rows));
      CHECK(batch.status()[2] == static_cast<std::int8_t>(Status::BadInput));
    }
    for (std::size_t i = 0; i < 42; ++i) {
      if (i / 7 == 2) {
        CHECK(batch.qdot()[i] == 0.0);  // it has come to rest
      } else {
        CHECK(batch.q()[i] == clean.q()[i]);
      }
    }
  }
  Rows feedforward(36, 0.1);
  feedforward[6 * 4] = kNan;
  REQUIRE(batch.update(rows, feedforward));
  CHECK(batch.status()[4] == static_cast<std::int8_t>(Status::BadInput));
  CHECK(batch.status()[3] != static_cast<std::int8_t>(Status::BadInput));
}

TEST_CASE("wrong sizes are refused, and what is refused changes nothing") {
  Random random(3);
  CHECK_THROWS_AS(ServoBatch(arm(), JParse{}, {}, 0), Error);
  CHECK_THROWS_AS(ServoBatch(arm(), JParse{}, {}, 1, 0), Error);
  CHECK_THROWS_AS(ServoBatch(arm(), JParse{}, {.dt = -1.0}, 1), Error);
  ServoBatch batch(arm(), JParse{}, {}, 3);
  const Rows start = starts(random, 3);
  batch.reset(start);
  for (const std::size_t bad : {0u, 1u, 6u, 14u, 22u}) CHECK_THROWS_AS(batch.reset(Rows(bad, 0.0)), Error);
  const std::vector<std::uint8_t> mask{1, 0};
  CHECK_THROWS_AS(batch.reset(start, mask), Error);
  CHECK_THROWS_AS(batch.reset(start, {}, Rows(8, 0.0)), Error);
  Rows broken = starts(random, 3);
  broken[15] = kNan;
  CHECK_THROWS_AS(batch.reset(broken), Error);
  CHECK_FALSE(batch.update(Rows(47, 0.0)));
  CHECK_FALSE(batch.update(targets(random, 3), Rows(17, 0.0)));
  CHECK_FALSE(batch.update_twist(Rows(19, 0.0)));
  CHECK(Rows(batch.q().begin(), batch.q().end()) == start);
}

TEST_CASE("the arrays stay where they are, also when the batch moves") {
  Random random(4);
  ServoBatch batch(arm(), JParse{}, {}, 3, 2);
  const double* const q = batch.q().data();
  batch.reset(starts(random, 3));
  REQUIRE(batch.update(targets(random, 3)));
  ServoBatch moved = std::move(batch);
  REQUIRE(moved.update(targets(random, 3)));
  CHECK(moved.q().data() == q);
}

#ifdef SIGMAIK_TEST_HEAP
TEST_CASE("a cycle uses no heap") {
  Random random(5);
  for (const int threads : {1, 2}) {
    ServoBatch batch(arm(), JParse{}, {.dt = 1e-2}, 8, threads);
    batch.reset(starts(random, 8));
    const Rows rows = targets(random, 8), along = twists(random, 8);
    const test::HeapWatch watch;
    for (int cycle = 0; cycle < 50; ++cycle) {
      batch.update(rows);
      batch.update_twist(along);
    }
    CHECK(watch.calls() == 0);
  }
}
#endif
