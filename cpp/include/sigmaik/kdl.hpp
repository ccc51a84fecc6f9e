#pragma once
/// \file kdl.hpp
/// Conversion from and to KDL::Chain.
///
/// KDL::Chain and KDL::RigidBodyInertia hold no type of Eigen, so a program that includes the header may have any
/// compiler flags. KDL::JntArray and KDL's other arrays hold vectors of the Eigen that KDL's library was compiled with:
/// a file that makes or resizes one needs -DEIGEN_MAX_ALIGN_BYTES=16 beside -mavx or -march=native (Debian's KDL).

#include <string>

#include <kdl/chain.hpp>

#include <sigmaik/chain.hpp>

namespace sigmaik {

/// The arm that a KDL chain describes, any of KDL's joint types. KDL knows no limits, so all limits are infinite, and
/// rotary joints are Revolute, not Continuous; with_limits() gives limits.
///
/// Offsets become part of the origins, and a scale of −1 turns the axis. A KDL segment's tip may lie off its joint's
/// axis, a link's frame may not: such a segment becomes two, the joint with a link NAME_joint, and a fixed joint with
/// the link NAME and its inertia. Links and joints without a name ("NoName" in KDL) become link1, joint1, ….
/// \param base name of the base link, for which KDL has no place
/// \throws Error where a joint has a scale other than ±1, or where Chain throws
Chain from_kdl(const KDL::Chain& chain, const std::string& base = "base");

/// The same chain for KDL, segment for segment (fixed joints and inertias included), as kdl_parser makes it from a
/// URDF. Limits are lost. Mind that KDL's joints cache their last pose: a KDL::Chain is not for two threads at once.
KDL::Chain to_kdl(const Chain& chain);

/// KDL keeps the tensor about the link frame's origin, Inertia about the centre of mass.
KDL::RigidBodyInertia to_kdl(const Inertia& inertia);

}  // namespace sigmaik
