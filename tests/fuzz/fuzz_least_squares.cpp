// Bounded least squares of numbers made of bytes: the answer is finite, inside its bounds, and takes a bounded number
// of steps, also behind the guess of another problem.
#include <sigmaik/least_squares.hpp>

#include "bytes.hpp"

using namespace sigmaik;
using fuzz::Bytes;
using fuzz::demand;

namespace {

double entry(Bytes& bytes, int style) {
  switch (style) {
    case 0: return bytes.integer(-2, 2);
    case 1: return bytes.uniform(-1.0, 1.0);
    case 2: return bytes.decades(-12.0, 12.0) * (bytes.one_in(2) ? 1.0 : -1.0);
    default: return bytes.number(10.0);
  }
}

void fill(Bytes& bytes, int style, RowMatrix& matrix, RowVector& right, int rows, int n) {
  matrix.resize(rows, n);
  right.resize(rows);
  for (int k = 0; k < rows; ++k) {
    for (int i = 0; i < n; ++i) matrix(k, i) = entry(bytes, style);
    right[k] = entry(bytes, style);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Bytes bytes(data, size);
  LeastSquares solver;
  const int n = bytes.integer(1, kMaxUnknowns);
  for (int problems = 0; problems < 4 && !bytes.empty(); ++problems) {
    const int style = bytes.integer(0, 3);
    LeastSquaresProblem p;
    fill(bytes, style, p.A, p.b, bytes.integer(0, 10), n);
    fill(bytes, style, p.C, p.d, bytes.integer(0, kMaxEqualities), n);
    fill(bytes, style, p.G, p.h, bytes.integer(0, 10), n);
    p.lower.resize(n);
    p.upper.resize(n);
    for (int i = 0; i < n; ++i) {
      p.lower[i] = bytes.one_in(4) ? -fuzz::kInfinity : entry(bytes, style);
      p.upper[i] = bytes.one_in(4) ? fuzz::kInfinity : p.lower[i] + std::abs(entry(bytes, style));
    }
    const LeastSquaresSolution s = solver.solve(p);
    demand(s.x.size() == n && s.x.allFinite(), "a finite answer");
    const int most = 4 * (n + static_cast<int>(p.G.rows())) + 41;
    demand(s.steps >= 0 && s.steps <= most, "a bounded number of steps");
    if (s.status == LeastSquaresStatus::BadInput) continue;
    demand(((s.x - p.lower).array() >= 0.0).all() && ((p.upper - s.x).array() >= 0.0).all(), "inside the bounds");
  }
  return 0;
}
