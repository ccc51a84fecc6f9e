#include <sigmaik/values.hpp>

#include <utility>

#include "members.hpp"

namespace sigmaik {
namespace detail {
namespace {

constexpr std::string_view kMark = "sigK";
constexpr std::size_t kHeader = 4 + 4 + 8 + 8;  // mark, version, fingerprint, checksum

// What is written of a chain, which is made again of these parts. Chains are compared without the URDF, which matters
// to the shapes of collisions alone.
struct ChainParts {
  std::string base;
  std::vector<Segment> segments;
  std::string urdf;
};

}  // namespace

template <>
struct Members<ChainParts> {
  static constexpr std::tuple all{&ChainParts::base, &ChainParts::segments, &ChainParts::urdf};
};

namespace {

template <typename T>
const T& parts_of(const T& value) {
  return value;
}
ChainParts parts_of(const Chain& chain) { return {chain.base(), chain.segments(), {}}; }

template <typename T>
const T& written_of(const T& value) {
  return value;
}
ChainParts written_of(const Chain& chain) { return {chain.base(), chain.segments(), chain.urdf()}; }

template <typename T>
std::string with_header(const T& value) {
  Writer body, out;
  transfer(body, value);
  for (const char c : kMark) out.number(c);
  out.number(std::uint32_t{kValuesVersion});
  out.number(fingerprint<T>());
  out.number(hash_text(body.bytes()));
  return out.bytes() + body.bytes();
}

// Reads the bytes into `value`.
template <typename T>
void read(std::string_view bytes, int joints, T& value) {
  try {
    require(bytes.size() >= kHeader && bytes.substr(0, 4) == kMark, "no bytes of sigmaik");
    Reader header(bytes.substr(4, kHeader - 4), -1);
    std::uint32_t version = 0;
    std::uint64_t print = 0, checksum = 0;
    header.number(version);
    header.number(print);
    header.number(checksum);
    require(version == kValuesVersion, "version ", version, "; this library reads version ", kValuesVersion);
    require(print == fingerprint<T>(), "of another type, or of a library whose type has other members");
    const std::string_view body = bytes.substr(kHeader);
    require(checksum == hash_text(body), "the checksum is wrong: bytes were changed or are missing");
    Reader reader(body, joints);
    transfer(reader, value);
    require(reader.left() == 0, reader.left(), " bytes are left over");
  } catch (const Error& error) {
    throw Error(std::string("the bytes of a value are refused: ") + error.what());
  }
}

template <typename T>
std::string canonical(const T& value) {
  Writer out(true);
  transfer(out, value);
  return out.bytes();
}

int joints_of(const Servo& servo) { return servo.chain().dof(); }
int joints_of(const ConstrainedIk& ik) { return ik.chain().dof(); }
// A solver learns the number of joints from each Jacobian, and forgets a decomposition of another size.
int joints_of(const VelocitySolver& solver) { return static_cast<int>(solver.pace().slowness.size()); }
int joints_of(const TargetStream&) { return 0; }

}  // namespace
}  // namespace detail

template <typename Value>
std::string save(const Value& value) {
  return detail::with_header(detail::written_of(value));
}

template <typename Value>
Value load(std::string_view bytes) {
  if constexpr (std::is_same_v<Value, Chain>) {
    detail::ChainParts parts;
    detail::read(bytes, -1, parts);
    return detail::with_urdf(Chain(std::move(parts.base), std::move(parts.segments)), std::move(parts.urdf));
  } else {
    Value value;
    detail::read(bytes, -1, value);
    return value;
  }
}

template <typename Value>
bool same(const Value& one, const Value& other) {
  return &one == &other || detail::canonical(detail::parts_of(one)) == detail::canonical(detail::parts_of(other));
}

template <typename Value>
std::size_t hash(const Value& value) {
  return static_cast<std::size_t>(detail::hash_text(detail::canonical(detail::parts_of(value))));
}

template <typename Object>
std::string save_state(const Object& object) {
  return detail::with_header(object);
}

template <typename Object>
void load_state(Object& object, std::string_view bytes) {
  Object copy = object;
  detail::read(bytes, detail::joints_of(object), copy);
  object = std::move(copy);
}

template <typename Object>
bool same_state(const Object& one, const Object& other) {
  return &one == &other || detail::canonical(one) == detail::canonical(other);
}

#define SIGMAIK_VALUE(Type)                     \
  template std::string save(const Type&);       \
  template Type load<Type>(std::string_view);   \
  template bool same(const Type&, const Type&); \
  template std::size_t hash(const Type&)
#define SIGMAIK_STATE(Type)                          \
  template std::string save_state(const Type&);      \
  template void load_state(Type&, std::string_view); \
  template bool same_state(const Type&, const Type&)

SIGMAIK_VALUE(Chain);
SIGMAIK_VALUE(JointLimits);
SIGMAIK_VALUE(Inertia);
SIGMAIK_VALUE(Segment);
SIGMAIK_VALUE(ServoStep);
SIGMAIK_VALUE(ConstrainedIkStep);
SIGMAIK_VALUE(ComputedTorqueStep);
SIGMAIK_VALUE(Solution);
SIGMAIK_VALUE(Spectrum);
SIGMAIK_VALUE(LeastSquaresSolution);
SIGMAIK_VALUE(AnalyticBranch);
SIGMAIK_VALUE(PositionIkResult);
SIGMAIK_VALUE(PositionIkBranch);
SIGMAIK_VALUE(Target);
SIGMAIK_VALUE(SampleCounts);

SIGMAIK_STATE(Servo);
SIGMAIK_STATE(ConstrainedIk);
SIGMAIK_STATE(VelocitySolver);
SIGMAIK_STATE(TargetStream);

}  // namespace sigmaik
