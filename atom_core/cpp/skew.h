/// \file
/// The cross product as a matrix.

#ifndef ATOM_CORE_CPP_SKEW_H_
#define ATOM_CORE_CPP_SKEW_H_

#include <Eigen/Core>

namespace atom_core {

/// Skew(v) * w = v x w.
inline Eigen::Matrix3d Skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

}  // namespace atom_core

#endif  // ATOM_CORE_CPP_SKEW_H_
