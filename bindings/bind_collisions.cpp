#include "fields.hpp"

namespace sigmaik::bindings {
namespace {

const char* shape_name(Obstacle::Shape shape) {
  switch (shape) {
    case Obstacle::Shape::Sphere: return "sphere";
    case Obstacle::Shape::Capsule: return "capsule";
    case Obstacle::Shape::Box: return "box";
    case Obstacle::Shape::Cylinder: return "cylinder";
    case Obstacle::Shape::HalfSpace: break;
  }
  return "half-space";
}

// A centre (3,) or a pose (4, 4).
Pose place_argument(const py::object& object, const char* what) {
  const auto array = py::array::ensure(object);
  if (array && array.ndim() == 1) {
    Pose pose = Pose::Identity();
    pose.translation() = vector_argument(object, what);
    return pose;
  }
  PyErr_Clear();
  return pose_argument(object, what);
}

Obstacle named(Obstacle obstacle, const std::string& name, const std::vector<std::string>& links) {
  obstacle.name = name;
  obstacle.links = links;
  return obstacle;
}

using MaybeName = py::typing::Optional<py::str>;
using Found = py::typing::Tuple<py::float_, MaybeName, MaybeName, py::array_t<double>, py::array_t<double>>;

// An Obstacle, or a shape of sigmaik.planning: by what it has.
void add_obstacles(const py::handle& object, std::vector<Obstacle>& out) {
  if (py::isinstance<Obstacle>(object)) return out.push_back(object.cast<Obstacle>());
  const auto has = [&](const char* name) { return py::hasattr(object, name); };
  if (has("shapes")) {
    const py::sequence shapes = object.attr("shapes");
    if (shapes.empty()) throw Error("obstacles made of a grid have no shapes; a servo needs shapes");
    for (const py::handle shape : shapes) add_obstacles(shape, out);
  } else if (has("size") && has("pose")) {
    out.push_back(
        Obstacle::box(place_argument(object.attr("pose"), "pose"), vector_argument(object.attr("size"), "size")));
  } else if (has("radius") && has("center")) {
    out.push_back(
        Obstacle::sphere(vector_argument(object.attr("center"), "center"), object.attr("radius").cast<double>()));
  } else if (has("radius") && has("length") && has("pose")) {
    out.push_back(Obstacle::cylinder(place_argument(object.attr("pose"), "pose"), object.attr("radius").cast<double>(),
                                     object.attr("length").cast<double>()));
  } else {
    refuse("an obstacle", "a sigmaik.Obstacle, or a Box, Sphere or Cylinder of sigmaik.planning", object);
  }
}

std::vector<Obstacle> obstacles_argument(const py::object& obstacles) {
  std::vector<Obstacle> out;
  if (obstacles.is_none()) return out;
  if (py::hasattr(obstacles, "shapes")) {
    add_obstacles(obstacles, out);
    return out;
  }
  for (const py::handle obstacle : obstacles) add_obstacles(obstacle, out);
  return out;
}

void bind_capsule(py::module_& m) {
  py::class_<Capsule>(m, "Capsule", "All points within `radius` [m] of the segment from a to b; a sphere where a = b.")
      .def(py::init([](const ArrayLike& a, const ArrayLike& b, double radius) {
             return Capsule{vector_argument(a, "a"), vector_argument(b, "b"), radius};
           }),
           py::arg("a"), py::arg("b"), py::arg("radius"), "a, b: (3,) [m], the ends of the segment; radius [m] > 0.")
      .def_property_readonly(
          "a", [](const Capsule& c) { return to_numpy(c.a); }, "(3,) [m]")
      .def_property_readonly(
          "b", [](const Capsule& c) { return to_numpy(c.b); }, "(3,) [m]")
      .def_readonly("radius", &Capsule::radius, "[m]")
      .def("__repr__", [](const Capsule& c) {
        return record("Capsule", {{"a", to_numpy(c.a)}, {"b", to_numpy(c.b)}, {"radius", py::float_(c.radius)}});
      });
  py::class_<LinkCapsule>(m, "LinkCapsule", "A capsule that is fixed to a link.")
      .def(py::init([](const std::string& link, const Capsule& capsule) { return LinkCapsule{link, capsule, 0.0}; }),
           py::arg("link"), py::arg("capsule"), "link: the link's name; capsule: in the link's frame.")
      .def_readonly("link", &LinkCapsule::link, "The link's name.")
      .def_readonly("capsule", &LinkCapsule::capsule, "In the link's frame.")
      .def_readonly(
          "excess", &LinkCapsule::excess,
          "[m], how far the capsule stands out from the shapes that it covers, at most; 0 where it was given, "
          "NaN where the shape is a mesh.")
      .def("__repr__", [](const LinkCapsule& c) {
        return record("LinkCapsule", {{"", py::str(c.link)}, {"", py::cast(c.capsule)}});
      });
}

using Names = std::vector<std::string>;

void bind_obstacle_makers(py::class_<Obstacle>& c) {
  constexpr const char* kOthers =
      "name: how the obstacle is called; links: those that have to keep clear, all by default.";
  c.def_static(
       "sphere",
       [](const ArrayLike& center, double radius, const std::string& name, const Names& links) {
         return named(Obstacle::sphere(vector_argument(center, "center"), radius), name, links);
       },
       py::arg("center"), py::arg("radius"), py::kw_only(), py::arg("name") = "", py::arg("links") = Names{},
       (std::string("center (3,) [m], radius [m] > 0.\n\n") + kOthers).c_str())
      .def_static(
          "capsule",
          [](const ArrayLike& a, const ArrayLike& b, double radius, const std::string& name, const Names& links) {
            return named(Obstacle::capsule(vector_argument(a, "a"), vector_argument(b, "b"), radius), name, links);
          },
          py::arg("a"), py::arg("b"), py::arg("radius"), py::kw_only(), py::arg("name") = "",
          py::arg("links") = Names{}, (std::string("a, b (3,) [m], radius [m] > 0.\n\n") + kOthers).c_str())
      .def_static(
          "box",
          [](const ArrayLike& size, const ArrayLike& pose, const std::string& name, const Names& links) {
            return named(Obstacle::box(place_argument(pose, "pose"), vector_argument(size, "size")), name, links);
          },
          py::arg("size"), py::arg("pose"), py::kw_only(), py::arg("name") = "", py::arg("links") = Names{},
          (std::string("size (3,) [m] of its sides; pose: centre (3,) [m], or pose (4, 4).\n\n") + kOthers).c_str())
      .def_static(
          "cylinder",
          [](double radius, double length, const ArrayLike& pose, const std::string& name, const Names& links) {
            return named(Obstacle::cylinder(place_argument(pose, "pose"), radius, length), name, links);
          },
          py::arg("radius"), py::arg("length"), py::arg("pose"), py::kw_only(), py::arg("name") = "",
          py::arg("links") = Names{},
          (std::string("radius, length [m] > 0, along its z; pose: centre (3,) [m], or pose (4, 4).\n\n") + kOthers)
              .c_str())
      .def_static(
          "half_space",
          [](const ArrayLike& point, const ArrayLike& normal, const std::string& name, const Names& links) {
            return named(Obstacle::half_space(vector_argument(point, "point"), vector_argument(normal, "normal")), name,
                         links);
          },
          py::arg("point"), py::arg("normal"), py::kw_only(), py::arg("name") = "", py::arg("links") = Names{},
          (std::string("The side of the plane through `point` (3,) [m] that `normal` (3,) points away from: a floor, a "
                       "wall.\n\n") +
           kOthers)
              .c_str());
}

void bind_obstacle(py::module_& m) {
  py::class_<Obstacle> c(m, "Obstacle",
                         "A body of the world, in the axes of the arm's base: made by one of its makers.");
  bind_obstacle_makers(c);
  c.def_property_readonly(
       "shape", [](const Obstacle& o) { return py::str(shape_name(o.shape)); },
       "'sphere', 'capsule', 'box', 'cylinder' or 'half-space'.")
      .def_property_readonly(
          "pose", [](const Obstacle& o) { return to_numpy(o.pose.matrix()); },
          "(4, 4): capsules and cylinders lie along z, a half-space is z ≤ 0.")
      .def_property_readonly(
          "size", [](const Obstacle& o) { return to_numpy(o.size); },
          "(3,) [m] sphere: radius; capsule: radius, length of the segment; box: sides; cylinder: radius, length.")
      .def_readonly("name", &Obstacle::name, "Empty: obstacle i.")
      .def_property_readonly(
          "links", [](const Obstacle& o) { return Strings(py::tuple(py::cast(o.links))); },
          "The links that have to keep clear; empty: all that a joint moves.")
      .def("__repr__", [](const Obstacle& o) {
        return record("Obstacle", {{"", py::str(shape_name(o.shape))},
                                   {"name", o.name.empty() ? py::object(py::none()) : py::str(o.name)},
                                   {"size", to_numpy(o.size)}});
      });
}

CollisionOptions options_of(bool self_collision, double margin, const py::object& source, const py::object& srdf,
                            double radius, std::optional<int> capsules,
                            const std::vector<std::pair<Text, Text>>& ignore) {
  CollisionOptions options;
  options.margin = margin;
  options.self_collision = self_collision;
  if (!source.is_none()) options.source = source_argument(source);
  if (!srdf.is_none()) options.srdf = source_argument(srdf);
  options.radius = radius;
  options.capsules = capsules.value_or(0);
  if (capsules && *capsules < 1) throw Error("capsules = " + std::to_string(*capsules) + " must be above 0");
  options.ignore.assign(ignore.begin(), ignore.end());
  return options;
}

void bind_setup(py::class_<Collisions>& c) {
  c.def(py::init([](const Chain& chain, const py::object& obstacles, bool self_collision, double margin,
                    const py::object& source, const py::object& srdf, double radius, std::optional<int> capsules,
                    const std::vector<std::pair<Text, Text>>& ignore,
                    const std::optional<std::vector<LinkCapsule>>& arm) {
          const CollisionOptions options = options_of(self_collision, margin, source, srdf, radius, capsules, ignore);
          const std::vector<Obstacle> world = obstacles_argument(obstacles);
          return arm ? Collisions::with_capsules(chain, *arm, world, options) : Collisions(chain, world, options);
        }),
        py::arg("chain"), py::arg("obstacles") = py::none(), py::arg("self_collision") = true, py::arg("margin") = 0.01,
        py::kw_only(), py::arg("source") = py::none(), py::arg("srdf") = py::none(), py::arg("radius") = 0.05,
        py::arg("capsules") = py::none(), py::arg("ignore") = py::list(), py::arg("arm") = py::none(),
        "obstacles: up to 32 of Obstacle, or of the shapes Box, Sphere, Cylinder of sigmaik.planning, or an Obstacles "
        "of\n"
        "    these; None: none.\n"
        "self_collision: whether the arm keeps clear of itself.\n"
        "margin: [m] ≥ 0, no pair of bodies comes closer.\n"
        "source: URDF with the links' shapes, a path or XML; None: what the chain was read from. Without a URDF, "
        "capsules\n"
        "    run from each link's frame to the next.\n"
        "srdf: SRDF whose disable_collisions name pairs of links that need no check, a path or XML; None: none.\n"
        "radius: [m] > 0 of links with meshes, and without a URDF.\n"
        "capsules: the most that the arm gets, at least one a link; None: three more than joints.\n"
        "ignore: more pairs of links that need no check.\n"
        "arm: LinkCapsules of your own; None: capsules are fitted to the shapes.\n"
        "Raises Error where a number is out of its range, a link does not exist, or there are too many bodies.");
}

void bind_world(py::class_<Collisions>& c) {
  c.def(
       "move",
       [](Collisions& s, int i, const ArrayLike& pose, const MaybeArray& twist) {
         s.move(i, place_argument(pose, "pose"), twist ? twist_argument(*twist, "twist") : Twist(Twist::Zero()));
       },
       py::arg("i"), py::arg("pose"), py::arg("twist") = py::none(),
       "Moves obstacle i, from any thread, for all servos that have these collisions.\n\n"
       "pose: (4, 4) in the base's axes, or the place of its origin (3,) [m].\n"
       "twist: (6,) [v; ω] of its origin, base axes: until the next call it goes on like this, for at most 0.2 s.\n"
       "Raises Error where there is no obstacle i, or the pose is none.")
      .def("attach", &Collisions::attach, py::arg("capsules"),
           "Attaches an object of up to 4 capsules to the tip, in the tip's frame, in place of the one that the arm "
           "carries.")
      .def("detach", &Collisions::detach, "Lets go of the object.")
      .def("__copy__", [](const Collisions& s) { return s; })
      .def(
          "__deepcopy__", [](const Collisions& s, const py::object&) { return s; }, py::arg("memo"))
      .def(
          "distance",
          [](const Collisions& s, const ArrayLike& q) {
            const int n = s.chain().dof();
            return number_or_array(map_configurations(
                n, q, {}, [&](const JointVector& joints, double* out) { *out = s.nearest(joints).distance; }));
          },
          py::arg("q"), "The least distance [m] at q (n,), or (B,) at q (B, n); below 0: contact.")
      .def(
          "nearest",
          [](const Collisions& s, const ArrayLike& q) {
            const Proximity p = s.nearest(joint_argument(q, "q", s.chain().dof()));
            const auto name = [&](int i) {
              return i < 0 ? py::object(py::none()) : py::str(s.body_names()[static_cast<std::size_t>(i)]);
            };
            return Found(
                py::make_tuple(p.distance, name(p.body), name(p.other), to_numpy(p.point), to_numpy(p.other_point)));
          },
          py::arg("q"),
          "The nearest pair at q (n,): distance [m], the names of both bodies, and their nearest points (3,) [m] in "
          "base.");
}

void bind_properties(py::class_<Collisions>& c) {
  c.def_property_readonly("chain", &Collisions::chain, "The arm.")
      .def_property_readonly(
          "margin", [](const Collisions& s) { return s.options().margin; }, "[m]")
      .def_property_readonly("capsules", &Collisions::capsules, "The arm's LinkCapsules, base to tip.")
      .def_property_readonly("obstacles", &Collisions::obstacles, "The obstacles, as given.")
      .def_property_readonly(
          "body_names", [](const Collisions& s) { return Strings(py::tuple(py::cast(s.body_names()))); },
          "Names of the arm's capsules, of the carried ones, and of the obstacles: what step.nearest counts.")
      .def_property_readonly("self_pairs", &Collisions::self_pairs,
                             "Pairs of the arm's capsules that are checked, by number.")
      .def("__repr__", [](const Collisions& s) {
        return record("Collisions", {{"", py::cast(s.chain())},
                                     {"capsules", py::int_(s.capsules().size())},
                                     {"self_pairs", py::int_(s.self_pairs().size())},
                                     {"obstacles", py::int_(s.obstacles().size())},
                                     {"margin", py::float_(s.options().margin)}});
      });
}

}  // namespace

void bind_collisions(py::module_& m) {
  bind_capsule(m);
  bind_obstacle(m);
  py::class_<Collisions> c(
      m, "Collisions",
      "What an arm must not touch: itself, and obstacles. For Servo(chain, collisions=…).\n\n"
      "Capsules cover the links' shapes; distances between capsules, and to obstacles, are exact. Pairs of links with "
      "two\n"
      "or more joints between them are checked, but for those that are near at nine of ten configurations. All servos\n"
      "with the same Collisions share its obstacles and its carried object.");
  bind_setup(c);
  bind_world(c);
  bind_properties(c);
}

}  // namespace sigmaik::bindings
