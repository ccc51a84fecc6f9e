#include <sigmaik/status.hpp>

namespace sigmaik {

const char* to_string(Status status) noexcept {
  switch (status) {
    case Status::Ok: return "ok";
    case Status::Damped: return "damped";
    case Status::Limited: return "limited";
    case Status::Holding: return "holding";
    case Status::BadInput: return "bad input";
  }
  return "unknown";
}

}  // namespace sigmaik
