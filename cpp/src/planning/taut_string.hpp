#pragma once
// The shortest string through a tube.

#include <cstddef>
#include <vector>

namespace sigmaik::planning::detail {

// A taut string in a tube, after the funnels of Lee and Preparata (1984). From the last corner on, the chain `low` is
// the least concave function above the lower bounds, `high` the greatest convex one below the upper bounds. A bound
// that the other chain stands in the way of pulls the string around that chain.
class Funnel {
 public:
  /// x, and the indices of its corners, both ends among them, over n increasing abscissae `at`; the ends are where both
  /// bounds are equal.
  void draw(int n, const double* at, const double* lower, const double* upper, double* x, std::vector<int>& corners);

 private:
  struct Point {
    double t, x;
    int index;
  };
  struct Chain {
    std::vector<Point> points;
    std::size_t head = 0;

    void begin(const Point& p) {
      points.assign(1, p);
      head = 0;
    }
    std::size_t size() const { return points.size() - head; }
  };

  // kSign 1: p is a lower bound, `own` the concave chain, `other` the convex one; −1: mirrored.
  template <int kSign>
  void add(const Point& p, Chain& own, Chain& other, std::vector<int>& corners);

  Chain low_, high_;
  std::vector<double> value_;  // of the string at its corners
};

}  // namespace sigmaik::planning::detail
