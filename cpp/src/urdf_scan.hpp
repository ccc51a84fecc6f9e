#pragma once
// What keeps the reading of a URDF linear in the text's length.

#include <string_view>

namespace sigmaik::detail::xml {

// A URDF of a whole humanoid has some 0.3 MB.
inline constexpr std::size_t kLargestText = std::size_t{64} << 20;  // bytes
inline constexpr int kMostAttributes = 100;                         // of an element; URDF knows of 6
inline constexpr int kDeepest = 90;                                 // levels of elements, one in the other
inline constexpr std::size_t kLongestReference = 16;                // bytes of "&#x…;"

// Throws Error if the text exceeds one of these bounds. The scan is linear, and needs no well-formed XML: the scan and
// tinyxml2 take the same marks for tags up to the first malformed one, where tinyxml2 ends.
//
// Without the bounds tinyxml2 is quadratic in two places: each attribute is compared with all others of its element,
// and for each "&#" the rest of the text is searched for ";". tinyxml2 also recurses into elements.
void check_bounds(std::string_view text);

}  // namespace sigmaik::detail::xml
