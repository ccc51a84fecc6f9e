#pragma once
// urdfdom's view of an arm, from which the rest of the URDF is left out.

#include <string>
#include <vector>

#include <urdf_model/model.h>
#include <urdf_world/types.h>

#include "urdf_xml.hpp"

namespace sigmaik::detail {

// The URDF text of the path's joints and links alone.
std::string reduced(const xml::XMLElement& robot, const std::vector<const xml::TreeJoint*>& path);

// Parses a text by urdfdom. Throws Error with urdfdom's messages if urdfdom refuses the text. Safe to call from many
// threads.
urdf::ModelInterfaceSharedPtr parse_by_urdfdom(const std::string& text);

}  // namespace sigmaik::detail
