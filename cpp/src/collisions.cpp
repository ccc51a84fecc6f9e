// What an arm must not touch: capsules, pairs and obstacles, at set-up and as they move.

#include <sigmaik/collisions.hpp>

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include <sigmaik/pose.hpp>

#include "capsule_fit.hpp"
#include "collision_model.hpp"
#include "finite.hpp"
#include "link_frames.hpp"
#include "link_shapes.hpp"
#include "message.hpp"
#include "numbers.hpp"
#include "quasi_random.hpp"
#include "urdf_xml.hpp"

namespace sigmaik {
namespace {

using detail::BodyPair;
using detail::BodyState;
using detail::CollisionModel;
using detail::FittedCapsule;
using detail::kInfinity;
using detail::kMaxBodies;
using detail::LinkFrames;
using detail::require;
using LinkPairs = std::set<std::pair<std::string, std::string>>;

void require_length(const std::string& what, double value, bool zero_allowed = false) {
  require(std::isfinite(value) && (value > 0.0 || (zero_allowed && value == 0.0)), what, " = ", value,
          " m must be finite and ", zero_allowed ? "at least" : "above", " 0");
}

void require_capsule(const std::string& what, const Capsule& capsule) {
  require(capsule.a.allFinite() && capsule.b.allFinite(), what, ": its ends (", capsule.a.transpose(), "), (",
          capsule.b.transpose(), ") must be finite");
  require_length(what + ": radius", capsule.radius);
}

void require_obstacle(const std::string& what, const Obstacle& obstacle) {
  require(is_pose(obstacle.pose.matrix()), what, ": its pose is no rotation and translation");
  const auto size = [&](int i, const char* name, bool zero_allowed = false) {
    require_length(what + ": " + name, obstacle.size[i], zero_allowed);
  };
  switch (obstacle.shape) {
    case Obstacle::Shape::Sphere: return size(0, "radius");
    case Obstacle::Shape::Capsule: size(0, "radius"); return size(1, "length", true);
    case Obstacle::Shape::Box:
      for (int i = 0; i < 3; ++i) size(i, "side");
      return;
    case Obstacle::Shape::Cylinder: size(0, "radius"); return size(1, "length");
    case Obstacle::Shape::HalfSpace: return;
  }
}

// The number of joints that move a link.
int joints_of(const Chain& chain, const LinkFrames& frames, const std::string& what, const std::string& link) {
  if (link == chain.base()) return 0;
  for (std::size_t i = 0; i < chain.segments().size(); ++i) {
    if (chain.segments()[i].link_name == link) return frames.joints[i + 1];
  }
  throw Error(detail::message(what, ": the arm has no link '", link, "'"));
}

const std::string& link_name(const Chain& chain, int segment) {
  return segment < 0 ? chain.base() : chain.segments()[static_cast<std::size_t>(segment)].link_name;
}

int segment_of(const Chain& chain, const std::string& link) {
  for (std::size_t i = 0; i < chain.segments().size(); ++i) {
    if (chain.segments()[i].link_name == link) return static_cast<int>(i);
  }
  return -1;
}

void add_srdf(const std::string& source, LinkPairs& pairs) {
  detail::xml::with_label(source, [&](const std::string& text) {
    tinyxml2::XMLDocument document;
    const auto& robot = detail::xml::parse(text, document);
    for (auto* e = robot.FirstChildElement("disable_collisions"); e != nullptr;
         e = e->NextSiblingElement("disable_collisions")) {
      const char *a = e->Attribute("link1"), *b = e->Attribute("link2");
      require(a != nullptr && b != nullptr, "<disable_collisions> in line ", e->GetLineNum(), " needs link1 and link2");
      pairs.emplace(a, b);
      pairs.emplace(b, a);
    }
    return 0;
  });
}

std::vector<FittedCapsule> fitted(const Chain& chain, const CollisionOptions& options) {
  require_length("radius", options.radius);
  require(!chain.has_mimics(), "the arm has joints that mimic others; collisions of such arms are not checked");
  require(options.capsules >= 0 && options.capsules <= kMaxCapsules, "capsules = ", options.capsules, " must be 0 to ",
          kMaxCapsules);
  const std::string& source = options.source.empty() ? chain.urdf() : options.source;
  if (source.empty()) return detail::capsules_along_links(chain, options.radius);
  const std::vector<detail::LinkShape> shapes = detail::read_shapes(chain, source, !options.source.empty());
  require(!shapes.empty(), "the URDF gives no shape to any link between '", chain.base(), "' and '", chain.tip(),
          "'; without a URDF, capsules of the given radius run from link to link");
  const int most = options.capsules > 0 ? options.capsules : chain.dof() + 3;
  return detail::fit_capsules(chain, shapes, options.radius, most);
}

// Gathers capsules, pairs and names of a model.
class Builder {
 public:
  Builder(const Chain& chain, const CollisionOptions& options) : chain_(chain), options_(options), frames_(chain) {
    require_length("margin", options.margin, true);
    for (const auto& [a, b] : options.ignore) {
      joints_of(chain, frames_, "ignore", a);
      joints_of(chain, frames_, "ignore", b);
      ignored_.emplace(a, b);
      ignored_.emplace(b, a);
    }
    if (!options.srdf.empty()) add_srdf(options.srdf, ignored_);
  }

  std::shared_ptr<CollisionModel> build(std::vector<FittedCapsule> capsules, const std::vector<Obstacle>& obstacles) {
    require(capsules.size() <= kMaxCapsules, "the arm has ", capsules.size(), " capsules; at most ", kMaxCapsules,
            " are supported");
    require(obstacles.size() <= kMaxObstacles, "there are ", obstacles.size(), " obstacles; at most ", kMaxObstacles,
            " are supported");
    detail::SceneState state;
    for (std::size_t i = 0; i < obstacles.size(); ++i) {
      require_obstacle("obstacle " + std::to_string(i), obstacles[i]);
      const Pose pose = nearest_pose(obstacles[i].pose);
      state.obstacles[i].rotation = pose.linear();
      state.obstacles[i].translation = pose.translation();
    }
    model_ = std::make_shared<CollisionModel>(chain_, options_, state, static_cast<int>(obstacles.size()));
    model_->obstacles = obstacles;
    model_->tip_in_joint = chain_.tool();
    model_->reserve = 0.1 * options_.margin + 1e-3 * chain_.characteristic_length();
    const auto order = [&](const FittedCapsule& c) { return frames_.joints[static_cast<std::size_t>(c.segment + 1)]; };
    std::stable_sort(capsules.begin(), capsules.end(),
                     [&](const FittedCapsule& a, const FittedCapsule& b) { return order(a) < order(b); });
    for (const FittedCapsule& capsule : capsules) add_body(capsule);
    for (int i = 0; i < kMaxCarried; ++i) add_slot(i);
    add_names();
    add_pairs(capsules);
    return model_;
  }

 private:
  void add_body(const FittedCapsule& fitted) {
    const auto link = static_cast<std::size_t>(fitted.segment + 1);
    detail::ArmBody body;
    body.joints = frames_.joints[link];
    body.capsule = {frames_.in_joint[link] * fitted.capsule.a, frames_.in_joint[link] * fitted.capsule.b,
                    fitted.capsule.radius};
    set_reach(std::max(body.capsule.a.norm(), body.capsule.b.norm()), body);
    model_->bodies.push_back(body);
    model_->capsules.push_back({link_name(chain_, fitted.segment), fitted.capsule, fitted.excess});
  }

  void add_slot(int) {
    detail::ArmBody body;
    body.joints = chain_.dof();
    set_reach(0.0, body);
    model_->bodies.push_back(body);
  }

  // From the last joint backwards: a joint more, and the way to this joint.
  void set_reach(double reach, detail::ArmBody& body) const {
    for (int j = body.joints - 1; j >= 0; --j) {
      body.reach[static_cast<std::size_t>(j)] = reach;
      reach += chain_.constants()[static_cast<std::size_t>(j)].translation.norm();
    }
  }

  void add_names() {
    std::vector<std::string>& names = model_->names;
    for (const LinkCapsule& capsule : model_->capsules) {
      int count = 1;
      for (std::size_t k = 0; k < names.size(); ++k) count += model_->capsules[k].link == capsule.link ? 1 : 0;
      names.push_back(capsule.link + (count > 1 ? "/" + std::to_string(count) : ""));
    }
    for (int i = 1; i <= kMaxCarried; ++i) names.push_back("carried " + std::to_string(i));
    for (std::size_t i = 0; i < model_->obstacles.size(); ++i) {
      const std::string& name = model_->obstacles[i].name;
      names.push_back(name.empty() ? "obstacle " + std::to_string(i) : name);
    }
  }

  void add_pairs(const std::vector<FittedCapsule>& capsules) {
    const int count = static_cast<int>(capsules.size());
    if (options_.self_collision) {
      for (int i = 0; i < count; ++i) {
        for (int k = 0; k < i; ++k) {
          if (may_touch(i, k) &&
              !ignored(capsules[static_cast<std::size_t>(i)], capsules[static_cast<std::size_t>(k)])) {
            model_->pairs.push_back(between(i, k));
          }
        }
      }
      drop_contacts();
    }
    for (int i = 0; i < count; ++i) add_obstacles(i);
    model_->pairs_without_carried = static_cast<int>(model_->pairs.size());
    for (int i = count; i < count + kMaxCarried; ++i) {
      for (int k = 0; options_.self_collision && k < count; ++k) {
        if (!may_touch(i, k)) continue;
        model_->pairs.push_back(between(i, k));
        model_->pairs.back().carried = true;
      }
      const std::size_t before = model_->pairs.size();
      add_obstacles(i);
      for (std::size_t k = before; k < model_->pairs.size(); ++k) model_->pairs[k].carried = true;
    }
  }

  int joints(int body) const { return model_->bodies[static_cast<std::size_t>(body)].joints; }
  bool may_touch(int far, int near) const { return joints(far) >= joints(near) + 2; }
  BodyPair between(int far, int near) const { return {far, near, joints(near), joints(far), false}; }

  bool ignored(const FittedCapsule& a, const FittedCapsule& b) const {
    if (ignored_.empty()) return false;
    for (const int of_a : a.segments) {
      for (const int of_b : b.segments) {
        if (ignored_.count({link_name(chain_, of_a), link_name(chain_, of_b)}) == 0) return false;
      }
    }
    return true;
  }

  void add_obstacles(int body) {
    if (joints(body) == 0) return;
    for (std::size_t i = 0; i < model_->obstacles.size(); ++i) {
      const Obstacle& obstacle = model_->obstacles[i];
      bool concerned = obstacle.links.empty();
      for (const std::string& link : obstacle.links) {
        const int moved = joints_of(chain_, frames_, "obstacle " + std::to_string(i), link);
        require(moved > 0, "obstacle ", i, ": no joint moves link '", link, "'");
        concerned = concerned || moved == joints(body);
      }
      if (concerned) model_->pairs.push_back({body, kMaxBodies + static_cast<int>(i), 0, joints(body), false});
    }
  }

  // Leaves out the pairs that are nearer than the margin nearly always.
  void drop_contacts() {
    constexpr int kSamples = 1000;
    constexpr double kMost = 0.9;
    std::vector<int> contacts(model_->pairs.size(), 0);
    const detail::QuasiRandom configuration(chain_);
    const detail::SceneState scene;
    BodyState state;
    for (int sample = 0; sample < kSamples; ++sample) {
      detail::place_bodies(*model_, configuration(sample), scene, state);
      for (std::size_t k = 0; k < contacts.size(); ++k) {
        const auto a = static_cast<std::size_t>(model_->pairs[k].body),
                   b = static_cast<std::size_t>(model_->pairs[k].other);
        const double distance = detail::segment_to_segment(state.a[a], state.b[a], state.a[b], state.b[b]).distance -
                                model_->bodies[a].capsule.radius - model_->bodies[b].capsule.radius;
        if (distance < options_.margin) ++contacts[k];
      }
    }
    std::vector<BodyPair> kept;
    for (std::size_t k = 0; k < contacts.size(); ++k) {
      if (contacts[k] < kMost * kSamples) kept.push_back(model_->pairs[k]);
    }
    model_->pairs = std::move(kept);
  }

  const Chain& chain_;
  const CollisionOptions& options_;
  LinkFrames frames_;
  LinkPairs ignored_;
  std::shared_ptr<CollisionModel> model_;
};

}  // namespace

Obstacle Obstacle::sphere(const Eigen::Vector3d& center, double radius) {
  Obstacle out;
  out.pose.translation() = center;
  out.size[0] = radius;
  return out;
}

Obstacle Obstacle::capsule(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double radius) {
  require(a.allFinite() && b.allFinite(), "a capsule's ends (", a.transpose(), "), (", b.transpose(),
          ") must be finite");
  Obstacle out;
  out.shape = Shape::Capsule;
  const double length = (b - a).norm();
  out.pose.translation() = 0.5 * (a + b);
  if (length > 0.0) {
    out.pose.linear() = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), Eigen::Vector3d((b - a) / length))
                            .matrix();
  }
  out.size = {radius, length, 0.0};
  return out;
}

Obstacle Obstacle::box(const Pose& pose, const Eigen::Vector3d& sides) {
  Obstacle out;
  out.shape = Shape::Box;
  out.pose = pose;
  out.size = sides;
  return out;
}

Obstacle Obstacle::cylinder(const Pose& pose, double radius, double length) {
  Obstacle out;
  out.shape = Shape::Cylinder;
  out.pose = pose;
  out.size = {radius, length, 0.0};
  return out;
}

Obstacle Obstacle::half_space(const Eigen::Vector3d& point, const Eigen::Vector3d& normal) {
  require(normal.allFinite() && normal.norm() > 0.0, "a half-space's normal (", normal.transpose(),
          ") must be finite and not zero");
  Obstacle out;
  out.shape = Shape::HalfSpace;
  out.pose.translation() = point;
  out.pose.linear() = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), Eigen::Vector3d(normal.normalized()))
                          .matrix();
  return out;
}

Collisions::Collisions(const Chain& chain, const std::vector<Obstacle>& obstacles, const CollisionOptions& options)
    : model_(Builder(chain, options).build(fitted(chain, options), obstacles)) {}

Collisions Collisions::with_capsules(const Chain& chain, const std::vector<LinkCapsule>& arm,
                                     const std::vector<Obstacle>& obstacles, const CollisionOptions& options) {
  const LinkFrames frames(chain);
  std::vector<FittedCapsule> capsules;
  for (std::size_t i = 0; i < arm.size(); ++i) {
    const std::string what = "capsule " + std::to_string(i);
    joints_of(chain, frames, what, arm[i].link);
    require_capsule(what, arm[i].capsule);
    const int segment = segment_of(chain, arm[i].link);
    capsules.push_back({segment, arm[i].capsule, arm[i].excess, {segment}});
  }
  return Collisions(Builder(chain, options).build(std::move(capsules), obstacles));
}

void Collisions::move(int i, const Pose& pose, const Twist& twist) {
  const int count = static_cast<int>(model_->obstacles.size());
  require(i >= 0 && i < count, "there is no obstacle ", i, "; there are ", count);
  require(is_pose(pose.matrix()), "obstacle ", i, ": its pose is no rotation and translation");
  require(detail::finite(twist), "obstacle ", i, ": its twist must be finite");
  require(
      model_->obstacles[static_cast<std::size_t>(i)].shape != Obstacle::Shape::HalfSpace || twist.tail<3>().isZero(0.0),
      "obstacle ", i, ": a half-space has no end, so it cannot turn at a rate");
  const Pose exact = nearest_pose(pose);
  model_->scene.write([&](detail::SceneState& state) {
    state.obstacles[static_cast<std::size_t>(i)] = {exact.linear(), exact.translation(), twist.head<3>(),
                                                    twist.tail<3>()};
  });
}

void Collisions::attach(const std::vector<Capsule>& object) {
  require(object.size() <= kMaxCarried, "the object has ", object.size(), " capsules; at most ", kMaxCarried,
          " are supported");
  for (std::size_t i = 0; i < object.size(); ++i) require_capsule("capsule " + std::to_string(i), object[i]);
  model_->scene.write([&](detail::SceneState& state) {
    state.carried_count = static_cast<int>(object.size());
    std::copy(object.begin(), object.end(), state.carried.begin());
  });
}

Proximity Collisions::nearest(const JointRef& q) const noexcept {
  Proximity out;
  if (q.size() != model_->chain.dof() || !detail::finite(JointVector(q))) return out;
  detail::SceneState scene;
  std::uint64_t version = 0;
  while (!model_->scene.read(scene, version)) {
  }
  BodyState state;
  detail::place_bodies(*model_, q, scene, state);
  const auto radius = [&](int body) {
    const int slot = body - model_->first_carried();
    return slot < 0 ? model_->bodies[static_cast<std::size_t>(body)].capsule.radius
                    : scene.carried[static_cast<std::size_t>(slot)].radius;
  };
  for (const BodyPair& pair : model_->pairs) {
    if (pair.carried && pair.body >= model_->first_carried() + scene.carried_count) continue;
    const auto at = static_cast<std::size_t>(pair.body);
    detail::Nearest found;
    double away = radius(pair.body);
    if (pair.obstacle()) {
      const auto i = static_cast<std::size_t>(pair.other - kMaxBodies);
      found = detail::segment_to_shape(state.a[at], state.b[at],
                                       detail::placed(model_->obstacles[i], scene.obstacles[i], 0.0));
    } else {
      const auto other = static_cast<std::size_t>(pair.other);
      found = detail::segment_to_segment(state.a[at], state.b[at], state.a[other], state.b[other]);
      away += radius(pair.other);
    }
    found.distance -= away;
    if (!(found.distance < out.distance)) continue;
    out.distance = found.distance;
    out.body = pair.body;
    out.other = model_->name_index(pair.other);
    out.point = found.point - radius(pair.body) * found.normal;
    out.other_point = out.point - found.distance * found.normal;
  }
  return out;
}

const Chain& Collisions::chain() const noexcept { return model_->chain; }
const CollisionOptions& Collisions::options() const noexcept { return model_->options; }
const std::vector<LinkCapsule>& Collisions::capsules() const noexcept { return model_->capsules; }
const std::vector<std::string>& Collisions::body_names() const noexcept { return model_->names; }
const std::vector<Obstacle>& Collisions::obstacles() const noexcept { return model_->obstacles; }

std::vector<std::pair<int, int>> Collisions::self_pairs() const {
  std::vector<std::pair<int, int>> out;
  for (const BodyPair& pair : model_->pairs) {
    if (!pair.obstacle() && !pair.carried) out.emplace_back(pair.body, pair.other);
  }
  return out;
}

}  // namespace sigmaik
