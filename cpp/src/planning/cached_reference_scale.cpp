#include <algorithm>
#include <deque>
#include <mutex>
#include <vector>

#include <sigmaik/indices.hpp>
#include <sigmaik/planning/costs/geometry_aware.hpp>

namespace sigmaik::planning::costs {
namespace {

// All that reference_scale() depends on.
std::vector<double> key_of(const Chain& chain) {
  std::vector<double> key;
  const auto add = [&key](const auto& values) { key.insert(key.end(), values.data(), values.data() + values.size()); };
  for (std::size_t i = 0; i < static_cast<std::size_t>(chain.moving()); ++i) {
    const Coupling& coupling = chain.couplings()[i];
    key.insert(key.end(), {static_cast<double>(coupling.joint), coupling.multiplier, coupling.offset});
    const JointConstants& joint = chain.constants()[i];
    add(joint.rotation);
    add(joint.translation);
    key.push_back(joint.prismatic ? 1.0 : 0.0);
  }
  add(chain.tool().matrix());
  add(chain.limits().lower);
  add(chain.limits().upper);
  return key;
}

struct Entry {
  std::vector<double> key;
  double scale;
};

}  // namespace

double cached_reference_scale(const Chain& chain) {
  constexpr std::size_t kEntries = 32;
  static std::mutex mutex;
  static std::deque<Entry> entries;
  const std::vector<double> key = key_of(chain);
  const auto find = [&] {
    return std::find_if(entries.begin(), entries.end(), [&](const Entry& entry) { return entry.key == key; });
  };
  {
    const std::lock_guard lock(mutex);
    if (const auto known = find(); known != entries.end()) return known->scale;
  }
  const double scale = reference_scale(chain);
  const std::lock_guard lock(mutex);
  if (find() == entries.end()) {
    entries.push_back({key, scale});
    if (entries.size() > kEntries) entries.pop_front();
  }
  return scale;
}

}  // namespace sigmaik::planning::costs
