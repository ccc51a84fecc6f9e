#pragma once
// Values as bytes: one walk over the members of a type, which writes, reads, or makes the fingerprint of the type.

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include <sigmaik/types.hpp>

#include "message.hpp"

namespace sigmaik::detail {

// ---- Lists of members -----------------------------------------------------------------------------------------------

// Members<T>::all is a tuple with an entry for each member of T, in the order of the struct: a pointer to the member,
// or one of the two below. Members<T> may have more:
//   - prepare(object): called before an object is read
//   - rest(archive, object): called after the members, with the same calls for writing and for reading
//   - check(object): throws Error where members that were read contradict each other

// A member that the constructor makes of its arguments, or that rest() sees to: neither written nor read.
template <typename Owner, typename Value>
struct Made {
  Value Owner::* member;
};
template <typename Owner, typename Value>
constexpr Made<Owner, Value> made(Value Owner::* member) {
  return {member};
}

// A number, or an enum, in [low, high].
template <typename Owner, typename Value>
struct Ranged {
  Value Owner::* member;
  Value low, high;
};
template <typename Owner, typename Value>
constexpr Ranged<Owner, Value> ranged(Value Owner::* member, std::type_identity_t<Value> low,
                                      std::type_identity_t<Value> high) {
  return {member, low, high};
}

template <typename T>
concept Listed = requires { Members<T>::all; };

template <typename Owner, typename Value>
Value member_of(Value Owner::*);
template <typename Owner, typename Value>
Value member_of(Made<Owner, Value>);
template <typename Owner, typename Value>
Value member_of(Ranged<Owner, Value>);

// Whether the sizes of the members that are listed add up to that of the type. (A member that fits into the padding of
// the others is not missed.)
template <typename T>
constexpr bool lists_all() {
  std::size_t at = 0;
  std::apply(
      [&](const auto&... entry) {
        const auto place = [&]<typename Member>(std::type_identity<Member>) {
          at = (at + alignof(Member) - 1) / alignof(Member) * alignof(Member) + sizeof(Member);
        };
        (place(std::type_identity<decltype(member_of(entry))>{}), ...);
      },
      Members<T>::all);
  return (at + alignof(T) - 1) / alignof(T) * alignof(T) == sizeof(T);
}

// ---- Kinds of types -------------------------------------------------------------------------------------------------

template <typename T>
struct IsVector : std::false_type {};
template <typename T>
struct IsVector<std::vector<T>> : std::true_type {};
template <typename T>
struct IsArray : std::false_type {};
template <typename T, std::size_t size>
struct IsArray<std::array<T, size>> : std::true_type {};
template <typename T>
struct IsOptional : std::false_type {};
template <typename T>
struct IsOptional<std::optional<T>> : std::true_type {};
template <typename T>
concept Number = std::is_arithmetic_v<T> || std::is_enum_v<T>;
template <typename T>
concept Matrix = std::is_base_of_v<Eigen::PlainObjectBase<T>, T>;

constexpr std::uint64_t kHashStart = 14695981039346656037u;  // FNV-1a
constexpr std::uint64_t hash_byte(std::uint64_t hash, std::uint8_t byte) { return (hash ^ byte) * 1099511628211u; }
constexpr std::uint64_t hash_number(std::uint64_t hash, std::uint64_t number) {
  for (int i = 0; i < 8; ++i) hash = hash_byte(hash, static_cast<std::uint8_t>(number >> (8 * i)));
  return hash;
}
inline std::uint64_t hash_text(std::string_view text) {
  std::uint64_t hash = kHashStart;
  for (const char c : text) hash = hash_byte(hash, static_cast<std::uint8_t>(c));
  return hash;
}

// A number for the kinds and the order of everything that is written of a T: another list has another number.
template <typename T>
constexpr std::uint64_t fingerprint() {
  if constexpr (Number<T>) {
    return hash_number(kHashStart, 16 * sizeof(T) + (std::is_floating_point_v<T> ? 1 : 0));
  } else if constexpr (std::is_same_v<T, std::string>) {
    return hash_number(kHashStart, 2);
  } else if constexpr (IsVector<T>::value) {
    return hash_number(fingerprint<typename T::value_type>(), 3);
  } else if constexpr (IsOptional<T>::value) {
    return hash_number(fingerprint<typename T::value_type>(), 4);
  } else if constexpr (IsArray<T>::value) {
    return hash_number(fingerprint<typename T::value_type>(), 16 * std::tuple_size_v<T> + 5);
  } else if constexpr (std::is_same_v<T, Pose>) {
    return hash_number(kHashStart, 6);
  } else if constexpr (Matrix<T>) {
    return hash_number(hash_number(kHashStart, 7 + 16 * (T::RowsAtCompileTime + 1)), T::ColsAtCompileTime + 1);
  } else {
    std::uint64_t out = hash_number(kHashStart, 8);
    std::apply(
        [&](const auto&... entry) {
          const auto add = [&]<typename Entry>(const Entry&) {
            using Member = decltype(member_of(std::declval<Entry>()));
            if constexpr (std::is_member_object_pointer_v<Entry> || requires(Entry e) { e.low; }) {
              out = hash_number(out, fingerprint<Member>());
            }
          };
          (add(entry), ...);
        },
        Members<T>::all);
    if constexpr (requires { Members<T>::kRest; }) out = hash_number(out, Members<T>::kRest);
    return out;
  }
}

// ---- Writing and reading --------------------------------------------------------------------------------------------

class Writer {
 public:
  static constexpr bool kReads = false;

  // `canonical`: NaN and −0 are written as every NaN and 0 are, so that values that are the same have the same bytes.
  explicit Writer(bool canonical = false) : canonical_(canonical) {}

  template <Number T>
  void number(const T& given) {
    T value = given;
    if constexpr (std::is_floating_point_v<T>) {
      if (canonical_ && value == T{0}) value = T{0};
      if (canonical_ && std::isnan(value)) value = std::numeric_limits<T>::quiet_NaN();
    }
    using Bits = std::array<std::uint8_t, sizeof(T)>;
    Bits bits = std::bit_cast<Bits>(value);
    if constexpr (std::endian::native == std::endian::big) std::reverse(bits.begin(), bits.end());
    out_.append(bits.begin(), bits.end());
  }
  void text(const std::string& value) {
    number(static_cast<std::uint32_t>(value.size()));
    out_ += value;
  }
  const std::string& bytes() const noexcept { return out_; }

 private:
  bool canonical_;
  std::string out_;
};

class Reader {
 public:
  static constexpr bool kReads = true;

  // `joints`: of an arm's state, whose vectors (n,) are empty or have this size; −1: of a value, of any size.
  Reader(std::string_view bytes, int joints) : bytes_(bytes), joints_(joints) {}

  template <Number T>
  void number(T& value) {
    using Bits = std::array<std::uint8_t, sizeof(T)>;
    Bits bits{};
    const std::string_view part = take(sizeof(T));
    std::memcpy(bits.data(), part.data(), sizeof(T));
    if constexpr (std::endian::native == std::endian::big) std::reverse(bits.begin(), bits.end());
    if constexpr (std::is_same_v<T, bool>) {
      require(bits[0] <= 1, "a truth value is ", int{bits[0]});
      value = bits[0] == 1;
    } else {
      value = std::bit_cast<T>(bits);
    }
    if constexpr (std::is_floating_point_v<T>) {
      require(joints_ < 0 || !std::isnan(value), "a number of the state is not a number");
    }
  }
  void text(std::string& value) {
    std::uint32_t size = 0;
    number(size);
    value = take(size);
  }
  // Throws where a matrix cannot have this size.
  void check_size(Eigen::Index rows, Eigen::Index cols, Eigen::Index most_rows, Eigen::Index most_cols,
                  bool joints) const {
    require(rows >= 0 && cols >= 0 && rows <= most_rows && cols <= most_cols, "a matrix is ", rows, " by ", cols,
            ", of at most ", most_rows, " by ", most_cols);
    const Eigen::Index n = most_cols == 1 ? rows : cols;
    require(!joints || joints_ < 0 || n == 0 || n == joints_, "a vector has ", n, " entries, the arm ", joints_,
            " joints");
  }
  std::size_t left() const noexcept { return bytes_.size(); }
  int joints() const noexcept { return joints_; }

 private:
  std::string_view take(std::size_t size) {
    require(size <= bytes_.size(), "the bytes end too early");
    const std::string_view out = bytes_.substr(0, size);
    bytes_.remove_prefix(size);
    return out;
  }

  std::string_view bytes_;
  int joints_;
};

template <typename Archive, typename T>
void transfer(Archive& archive, T& value);

template <typename Archive, typename T>
void transfer_matrix(Archive& archive, T& value) {
  using Plain = std::remove_const_t<T>;
  auto rows = static_cast<std::uint8_t>(value.rows()), cols = static_cast<std::uint8_t>(value.cols());
  if constexpr (Plain::RowsAtCompileTime == Eigen::Dynamic) archive.number(rows);
  if constexpr (Plain::ColsAtCompileTime == Eigen::Dynamic) archive.number(cols);
  if constexpr (Archive::kReads) {
    constexpr bool joints = std::is_same_v<Plain, JointVector> || std::is_same_v<Plain, Jacobian>;
    archive.check_size(rows, cols, Plain::MaxRowsAtCompileTime, Plain::MaxColsAtCompileTime, joints);
    value.resize(rows, cols);
  }
  for (Eigen::Index j = 0; j < cols; ++j) {
    for (Eigen::Index i = 0; i < rows; ++i) archive.number(value(i, j));
  }
}

// The members of a type, in the order of its list.
template <typename Archive, typename T>
void transfer_members(Archive& archive, T& value) {
  using Plain = std::remove_const_t<T>;
  static_assert(lists_all<Plain>(), "a member is missing in cpp/src/members.hpp, or its place is another");
  if constexpr (Archive::kReads && requires { Members<Plain>::prepare(value); }) Members<Plain>::prepare(value);
  std::apply(
      [&](const auto&... entry) {
        const auto one = [&]<typename Entry>(const Entry& e) {
          if constexpr (std::is_member_object_pointer_v<Entry>) {
            transfer(archive, value.*e);
          } else if constexpr (requires { e.low; }) {
            transfer(archive, value.*e.member);
            if constexpr (Archive::kReads) {
              require(value.*e.member >= e.low && value.*e.member <= e.high, "a number is out of its range");
            }
          }
        };
        (one(entry), ...);
      },
      Members<Plain>::all);
  if constexpr (requires { Members<Plain>::rest(archive, value); }) Members<Plain>::rest(archive, value);
  if constexpr (Archive::kReads && requires { Members<Plain>::check(value); }) Members<Plain>::check(value);
}

template <typename Archive, typename T>
void transfer(Archive& archive, T& value) {
  using Plain = std::remove_const_t<T>;
  if constexpr (Number<Plain>) {
    archive.number(value);
  } else if constexpr (std::is_same_v<Plain, std::string>) {
    archive.text(value);
  } else if constexpr (IsVector<Plain>::value) {
    auto size = static_cast<std::uint32_t>(value.size());
    archive.number(size);
    if constexpr (Archive::kReads) {
      require(size <= archive.left(), "the bytes end too early");  // an entry has at least one byte
      value.assign(size, {});
    }
    for (auto& entry : value) transfer(archive, entry);
  } else if constexpr (IsOptional<Plain>::value) {
    bool there = value.has_value();
    archive.number(there);
    if constexpr (Archive::kReads) {
      value.reset();
      if (there) value.emplace();
    }
    if (there) transfer(archive, *value);
  } else if constexpr (IsArray<Plain>::value) {
    for (auto& entry : value) transfer(archive, entry);
  } else if constexpr (std::is_same_v<Plain, Pose>) {
    for (Eigen::Index j = 0; j < 4; ++j) {
      for (Eigen::Index i = 0; i < 4; ++i) archive.number(value.matrix()(i, j));
    }
  } else if constexpr (Matrix<Plain>) {
    transfer_matrix(archive, value);
  } else {
    transfer_members(archive, value);
  }
}

}  // namespace sigmaik::detail
