#pragma once
// Joints that mimic other joints of a chain.

#include <vector>

#include <sigmaik/chain.hpp>

namespace sigmaik::detail {

// The coupling of each segment: for a joint that moves, the number of the segment whose joint moves by itself, and the
// position of this joint, multiplier · (position of that joint) + offset. Mimics of mimics are followed to their end.
// A joint that moves by itself, and a fixed joint, has itself.
// Throws Error where a joint mimics a joint that does not move or is not in the chain, or itself in the end.
std::vector<Coupling> couplings_of(const std::vector<Segment>& segments);

// Makes the limits of joints that mimic others to limits of the joints that move by themselves: their position limits
// over the multiplier, and their other limits over its size. The mimicking joints keep no limits but the effort.
// Throws Error where no position is left.
void fold_limits(const std::vector<Coupling>& couplings, std::vector<Segment>& segments);

// Whether positions of joint i of q that are 2π apart have the same poses: the joint turns, and every joint that mimics
// it turns by whole turns with it.
bool repeats(const Chain& chain, int i) noexcept;

}  // namespace sigmaik::detail
