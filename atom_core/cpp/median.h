/// \file
/// The median of numbers.

#ifndef ATOM_CORE_CPP_MEDIAN_H_
#define ATOM_CORE_CPP_MEDIAN_H_

#include <algorithm>
#include <vector>

namespace atom_core {

/// Returns the median of one number or more; of an even number of them, the larger one amid.
inline double Median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
  return values[values.size() / 2];
}

}  // namespace atom_core

#endif  // ATOM_CORE_CPP_MEDIAN_H_
