#include <algorithm>
#include <cmath>
#include <limits>

#include <sigmaik/planning/collision_costs.hpp>

#include "arguments.hpp"

namespace sigmaik::bindings {
namespace {

using planning::ArmSpheres;
using planning::DistanceField;
using planning::JointCost;
using planning::JointCostPtr;
using planning::LinkSphere;
using planning::SpherePair;
using planning::SphereState;

using Points = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

std::shared_ptr<JointCost> bound(const JointCostPtr& cost) { return std::const_pointer_cast<JointCost>(cost); }

DistanceField field_argument(const ArrayLike& distances, const ArrayLike& origin, double cell) {
  const Array all = array_argument(distances, "distances", {-1, -1, -1}, "(X, Y, Z)");
  DistanceField::Shape shape;
  for (py::ssize_t axis = 0; axis < 3; ++axis) {
    if (all.shape(axis) > std::numeric_limits<int>::max())
      throw Error("distances has shape " + shape_text(all) + ", which is absurd");
    shape[static_cast<std::size_t>(axis)] = static_cast<int>(all.shape(axis));
  }
  return DistanceField({all.data(), all.data() + all.size()}, shape, vector_argument(origin, "origin"), cell);
}

// Calls fill(point, out) for a point (3,), or for every row of points (M, 3) without the GIL; `shape` is that of one
// result.
template <typename Fill>
py::array_t<double> map_points(const ArrayLike& points, std::vector<py::ssize_t> shape, Fill fill) {
  py::array any = py::array::ensure(points);
  if (!any) PyErr_Clear();
  const bool many = any && any.ndim() == 2;
  const char* const need = "(3,) or (M, 3)";
  const Array all = many ? array_argument(any, "points", {-1, 3}, need) : array_argument(points, "points", {3}, need);
  const py::ssize_t count = many ? all.shape(0) : 1, size = shape.empty() ? 1 : shape[0];
  if (many) shape.insert(shape.begin(), count);
  py::array_t<double> out(shape);
  double* const data = out.mutable_data();
  {
    py::gil_scoped_release release;
    for (py::ssize_t i = 0; i < count; ++i) {
      fill(Eigen::Vector3d(Eigen::Map<const Eigen::Vector3d>(all.data() + 3 * i)), data + i * size);
    }
  }
  return out;
}

std::string link_name(const Chain& chain, int segment) {
  return segment < 0 ? chain.base() : chain.segments()[static_cast<std::size_t>(segment)].link_name;
}

int segment_of(const Chain& chain, const std::string& link) {
  std::string names;
  for (int i = -1; i < static_cast<int>(chain.segments().size()); ++i) {
    if (link_name(chain, i) == link) return i;
    names += (names.empty() ? "'" : ", '") + link_name(chain, i) + "'";
  }
  throw Error("'" + link + "' is not a link of the arm; links: " + names);
}

std::vector<SpherePair> pairs_argument(const MaybeArray& pairs, const ArmSpheres& spheres, double clearance) {
  if (!pairs) return planning::self_collision_pairs(spheres, clearance);
  const Array all = array_argument(*pairs, "pairs", {-1, 2}, "(P, 2)");
  std::vector<SpherePair> out;
  for (py::ssize_t i = 0; i < all.size(); i += 2) {
    const double a = all.data()[i], b = all.data()[i + 1];
    for (const double index : {a, b}) {
      if (index != std::floor(index) || index < 0.0 || index >= spheres.size()) {
        throw Error("pairs[" + std::to_string(i / 2) + "]: there is no sphere " +
                    py::str(py::float_(index)).cast<std::string>() + "; the arm has " + std::to_string(spheres.size()));
      }
    }
    out.push_back({static_cast<int>(a), static_cast<int>(b)});
  }
  return out;
}

void bind_distance_field(py::module_& m) {
  py::class_<DistanceField>(
      m, "DistanceField",
      "Signed distances [m] to obstacles on a regular grid, interpolated trilinearly: positive in\n"
      "free space, negative inside. Outside the grid: continuous, growing, and no more than the\n"
      "distance to what lies within.")
      .def(py::init(&field_argument), py::arg("distances"), py::arg("origin"), py::arg("cell"),
           "distances (X, Y, Z) [m] at the nodes, the first of which is at `origin` (3,) [m] in the axes of the arm's "
           "base;\n"
           "`cell` [m] from node to node.")
      .def_property_readonly(
          "shape", [](const DistanceField& f) { return std::tuple{f.shape()[0], f.shape()[1], f.shape()[2]}; },
          "Nodes along each axis.")
      .def_property_readonly(
          "origin", [](const DistanceField& f) { return to_numpy(f.origin()); }, "(3,) [m] of the first node.")
      .def_property_readonly("cell", &DistanceField::cell, "[m]")
      .def(
          "distance",
          [](const DistanceField& f, const ArrayLike& points) {
            return number_or_array(
                map_points(points, {}, [&f](const Eigen::Vector3d& p, double* out) { *out = f.distance(p); }));
          },
          py::arg("points"), "[m] at a point (3,), or (M,) at points (M, 3).")
      .def(
          "gradient",
          [](const DistanceField& f, const ArrayLike& points) {
            return map_points(points, {3}, [&f](const Eigen::Vector3d& p, double* out) {
              Eigen::Vector3d gradient;
              f.distance(p, gradient);
              Eigen::Map<Eigen::Vector3d>{out} = gradient;
            });
          },
          py::arg("points"), "Gradient (3,) of the distance at a point (3,), or (M, 3) at points (M, 3).")
      .def("__repr__", [](const DistanceField& f) {
        return "DistanceField(" + std::to_string(f.shape()[0]) + "×" + std::to_string(f.shape()[1]) + "×" +
               std::to_string(f.shape()[2]) + " nodes, cell " + py::str(py::float_(f.cell())).cast<std::string>() +
               " m)";
      });
}

ArmSpheres make_spheres(const Chain& chain, const std::vector<std::string>& links, const ArrayLike& centers,
                        const ArrayLike& radii) {
  const auto count = static_cast<py::ssize_t>(links.size());
  const std::string length = std::to_string(count);
  const Array c = array_argument(centers, "centers", {count, 3}, ("(" + length + ", 3), one a link").c_str());
  const Array r = array_argument(radii, "radii", {count}, ("(" + length + ",), one a link").c_str());
  std::vector<LinkSphere> spheres;
  for (py::ssize_t i = 0; i < count; ++i) {
    spheres.push_back({segment_of(chain, links[static_cast<std::size_t>(i)]),
                       Eigen::Map<const Eigen::Vector3d>(c.data() + 3 * i), r.data()[i]});
  }
  return ArmSpheres(chain, std::move(spheres));
}

void bind_makers(py::class_<ArmSpheres>& c) {
  c.def(py::init(&make_spheres), py::arg("chain"), py::arg("links"), py::arg("centers"), py::arg("radii"),
        "links: the name of each sphere's link; centers (S, 3) [m] in the link's frame; radii (S,) [m].")
      .def_static(
          "from_urdf",
          [](const Chain& chain, const py::object& source, double radius) {
            return ArmSpheres::from_urdf(chain, source_argument(source), radius);
          },
          py::arg("chain"), py::arg("source"), py::arg("radius") = 0.05,
          "Covers the boxes, cylinders and spheres of a URDF; links with meshes as along_links does.")
      .def_static("along_links", &ArmSpheres::along_links, py::arg("chain"), py::arg("radius") = 0.05,
                  "Capsules from each link's frame to the next.");
}

void bind_parts(py::class_<ArmSpheres>& c) {
  c.def("__len__", &ArmSpheres::size)
      .def_property_readonly("chain", &ArmSpheres::chain, "The arm.")
      .def_property_readonly(
          "links",
          [](const ArmSpheres& s) {
            py::list out;
            for (const LinkSphere& sphere : s.spheres()) out.append(link_name(s.chain(), sphere.segment));
            return Strings(py::tuple(out));
          },
          "The name of each sphere's link.")
      .def_property_readonly(
          "radii",
          [](const ArmSpheres& s) {
            py::array_t<double> out(s.size());
            for (int i = 0; i < s.size(); ++i) out.mutable_data()[i] = s.radius(i);
            return out;
          },
          "(S,) [m]")
      .def_property_readonly(
          "local_centers",
          [](const ArmSpheres& s) {
            Points out(s.size(), 3);
            for (int i = 0; i < s.size(); ++i) out.row(i) = s.spheres()[static_cast<std::size_t>(i)].center;
            return to_numpy(out);
          },
          "(S, 3) [m] in the link's frame.")
      .def_property_readonly("first_moving", &ArmSpheres::first_moving,
                             "The first sphere that a joint moves; those before it belong to the base.");
}

void bind_kinematics(py::class_<ArmSpheres>& c) {
  c.def(
       "centers",
       [](const ArmSpheres& s, const ArrayLike& q) {
         SphereState state;
         return map_configurations(s.chain().dof(), q, {s.size(), 3}, [&](const JointVector& joints, double* out) {
           s.update(joints, state);
           for (int i = 0; i < s.size(); ++i) {
             Eigen::Map<Eigen::Vector3d>{out + 3 * i} = state.center[static_cast<std::size_t>(i)];
           }
         });
       },
       py::arg("q"), "(S, 3) [m] in the base's axes at q (n,); (B, S, 3) at q (B, n).")
      .def(
          "jacobians",
          [](const ArmSpheres& s, const ArrayLike& q) {
            SphereState state;
            planning::PointJacobian jacobian;
            const int n = s.chain().dof();
            return map_configurations(n, q, {s.size(), 3, n}, [&](const JointVector& joints, double* out) {
              s.update(joints, state);
              for (int i = 0; i < s.size(); ++i) {
                s.jacobian(i, state, jacobian);
                Eigen::Map<Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::RowMajor>>(out + 3 * n * i, 3, n) = jacobian;
              }
            });
          },
          py::arg("q"), "∂center/∂q (S, 3, n) at q (n,); (B, S, 3, n) at q (B, n).");
}

void bind_arm_spheres(py::module_& m) {
  py::class_<ArmSpheres> c(
      m, "ArmSpheres",
      "An arm as S spheres fixed to its links, in the order in which joints move them, base to tip.\n\n"
      "`sigmaik.planning.arm_spheres` makes them from a URDF, or along the links.");
  bind_makers(c);
  bind_parts(c);
  bind_kinematics(c);
  c.def("__repr__", [](const ArmSpheres& s) {
    return "ArmSpheres(" + std::to_string(s.size()) + " on " + std::to_string(s.chain().dof()) + " joints)";
  });
}

void bind_collision_costs(py::module_& m) {
  m.def(
      "collision_cost",
      [](const ArmSpheres& spheres, const DistanceField& field, double clearance, double weight) {
        return bound(planning::collision_cost(spheres, field, clearance, weight));
      },
      py::arg("spheres"), py::arg("field"), py::arg("clearance") = 0.05, py::arg("weight") = 1.0,
      "weight · Σ c(d) over the spheres that move, d the signed distance of their surfaces to the obstacles.");
  m.def(
      "self_collision_pairs",
      [](const ArmSpheres& spheres, double clearance, double most_contacts) {
        const std::vector<SpherePair> pairs = planning::self_collision_pairs(spheres, clearance, most_contacts);
        py::array_t<int> out({static_cast<py::ssize_t>(pairs.size()), py::ssize_t{2}});
        for (std::size_t i = 0; i < pairs.size(); ++i)
          std::copy(pairs[i].begin(), pairs[i].end(), out.mutable_data() + 2 * i);
        return out;
      },
      py::arg("spheres"), py::arg("clearance") = 0.02, py::arg("most_contacts") = 0.1,
      "(P, 2) spheres of links that are not neighbours, but for those nearer than `clearance` [m] at more than a "
      "share\n"
      "`most_contacts` (0 … 1) of a thousand configurations within the joint limits. The same on every machine; takes "
      "some\n"
      "ms.");
  m.def(
      "self_collision_cost",
      [](const ArmSpheres& spheres, const MaybeArray& pairs, double clearance, double weight) {
        return bound(
            planning::self_collision_cost(spheres, pairs_argument(pairs, spheres, clearance), clearance, weight));
      },
      py::arg("spheres"), py::arg("pairs") = py::none(), py::arg("clearance") = 0.02, py::arg("weight") = 1.0,
      "weight · Σ c(d) over pairs of spheres (P, 2), by default `self_collision_pairs(spheres, clearance)`;\n"
      "d the distance of their surfaces, c(d) as in `collision_cost`.");
  m.def(
      "joint_limit_cost",
      [](const Chain& chain, double margin, double weight) {
        return bound(planning::joint_limit_cost(chain, margin, weight));
      },
      py::arg("chain"), py::arg("margin") = 0.1, py::arg("weight") = 1.0,
      "weight · Σ ½x², x the way by which a joint is nearer to a limit than `margin` [rad or m], or beyond it.");
  m.def(
      "min_distance",
      [](const ArmSpheres& spheres, const DistanceField& field, const ArrayLike& q, int threads) -> NumberOrArray {
        const int n = spheres.chain().dof();
        const Batch batch = batch_argument(q, n);
        py::array_t<double> out(batch.many ? std::vector<py::ssize_t>{batch.count()} : std::vector<py::ssize_t>{});
        double* const data = out.mutable_data();
        {
          py::gil_scoped_release release;
          planning::min_distance(spheres, field, static_cast<std::size_t>(batch.count()), batch.q.data(), data,
                                 threads);
        }
        return number_or_array(out);
      },
      py::arg("spheres"), py::arg("field"), py::arg("q"), py::arg("threads") = 1,
      "The least signed distance [m] from a sphere that moves to the obstacles at q (n,), or (B,) at q (B, n).");
}

}  // namespace

void bind_obstacles(py::module_& m) {
  bind_distance_field(m);
  bind_arm_spheres(m);
  bind_collision_costs(m);
}

}  // namespace sigmaik::bindings
