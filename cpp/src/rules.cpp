#include <sigmaik/rules.hpp>

#include <type_traits>

namespace sigmaik {

const char* name(const Method& method) noexcept {
  return std::visit(
      []<typename R>(const R& rule) {
        if constexpr (std::is_same_v<R, CustomRule>) {
          return rule.name();
        } else {
          return R::kName;
        }
      },
      method);
}

double relative_threshold(const Method& method) noexcept {
  return std::visit([](const auto& rule) { return rule.relative_threshold(); }, method);
}

void validate(const Method& method) {
  std::visit(
      []<typename R>(const R& rule) {
        if constexpr (std::is_same_v<R, CustomRule>) {
          rule.check();
        } else {
          check_rule(rule);
        }
      },
      method);
}

Resolution resolve(const Method& method, const Spectrum& spectrum, const TaskVector& command,
                   std::uint8_t angular) noexcept {
  return std::visit(
      [&]<typename R>(const R& rule) {
        if constexpr (std::is_same_v<R, CustomRule>) {
          return rule.resolve(spectrum, command, angular);
        } else {
          return resolve_by(rule, spectrum, command, angular);
        }
      },
      method);
}

}  // namespace sigmaik
