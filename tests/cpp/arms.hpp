#pragma once
// The arms that come with the package.

#include <filesystem>
#include <map>
#include <set>
#include <string>

#include <sigmaik/chain.hpp>

namespace test {

/// The nine arms of the studies by name, up to their flange. The others are of the same families but for so101, with
/// five joints; tests of the files look at all (test_urdf, test_kdl).
inline const std::map<std::string, sigmaik::Chain>& arms() {
  static const std::set<std::string> others{"franka_fr3", "so101", "ufactory_xarm6", "ur3e", "ur5e"};
  static const std::map<std::string, sigmaik::Chain> all = [] {
    std::map<std::string, sigmaik::Chain> found;
    for (const auto& entry : std::filesystem::directory_iterator(SIGMAIK_ROBOTS_DIR)) {
      if (entry.path().extension() != ".urdf" || others.count(entry.path().stem().string()) != 0) continue;
      found.emplace(entry.path().stem().string(), sigmaik::Chain::from_urdf(entry.path().string(), "", "flange"));
    }
    return found;
  }();
  return all;
}

}  // namespace test
