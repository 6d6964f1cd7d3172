#include "fusion/chi_square.h"

#include <cmath>
#include <stdexcept>

namespace raceloc {

double chiSquareLimit(double false_alarm, int degrees_of_freedom) {
  if (!(false_alarm > 0 && false_alarm <= 1))
    throw std::invalid_argument("chiSquareLimit: the probability must be in (0, 1]");
  if (degrees_of_freedom != 2 && degrees_of_freedom != 3)
    throw std::invalid_argument("chiSquareLimit: 2 or 3 degrees of freedom");

  double x = -2 * std::log(false_alarm);
  if (degrees_of_freedom == 2 || x == 0) return x;

  // The logarithm of the tail is concave: after one step from the left the iteration falls monotonically.
  const double pi = std::acos(-1.0);
  for (int i = 0; i < 50; ++i) {
    const double density = std::sqrt(x / (2 * pi)) * std::exp(-x / 2);
    const double tail = std::erfc(std::sqrt(x / 2)) + 2 * density;
    const double step = std::log(tail / false_alarm) * tail / density;
    x += step;
    if (std::abs(step) < 1e-14 * x) break;
  }
  return x;
}

}  // namespace raceloc
