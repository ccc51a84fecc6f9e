// With SIGMAIK_DEFINE_LAYOUTS each public header defines the symbol that a program with the same types refers to.
#define SIGMAIK_DEFINE_LAYOUTS
#include <sigmaik/planning/arm_spheres.hpp>
#include <sigmaik/planning/batch_cost.hpp>
#include <sigmaik/planning/cart_motion.hpp>
#include <sigmaik/planning/cart_plane.hpp>
#include <sigmaik/planning/collision_check.hpp>
#include <sigmaik/planning/cost.hpp>
#include <sigmaik/planning/distance_field.hpp>
#include <sigmaik/planning/joint_cost.hpp>
#include <sigmaik/planning/plan.hpp>
#include <sigmaik/planning/play.hpp>
#include <sigmaik/planning/support_states.hpp>
#include <sigmaik/planning/time_optimal.hpp>
#include <sigmaik/servo_loop.hpp>
#include <sigmaik/sigmaik.hpp>
