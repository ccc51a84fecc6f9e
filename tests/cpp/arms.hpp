#pragma once
// The arms that come with the package.

#include <filesystem>
#include <map>
#include <string>

#include <sigmaik/chain.hpp>

namespace test {

/// The arms by name, up to their flange.
inline const std::map<std::string, sigmaik::Chain>& arms() {
  static const std::map<std::string, sigmaik::Chain> all = [] {
    std::map<std::string, sigmaik::Chain> found;
    for (const auto& entry : std::filesystem::directory_iterator(SIGMAIK_ROBOTS_DIR)) {
      if (entry.path().extension() != ".urdf") continue;
      found.emplace(entry.path().stem().string(), sigmaik::Chain::from_urdf(entry.path().string(), "", "flange"));
    }
    return found;
  }();
  return all;
}

}  // namespace test
