/// \file
/// Walls and floors that meet the plane of a board, as of one that leans at a
/// wall.

#ifndef ATOM_CORE_CPP_LARGER_PLANES_H_
#define ATOM_CORE_CPP_LARGER_PLANES_H_

#include <Eigen/Core>
#include <vector>

#include "scan_plane.h"
#include "scan_window.h"

namespace atom_core {

/// Planes of a window that are larger than the board. Along the line in which
/// one of them meets the plane of a board, returns lie on both: they belong to
/// the one that is nearer to the mean of their neighbours.
class LargerPlanes {
 public:
  /// The window must outlive this.
  explicit LargerPlanes(const Window &window) : window_(window) {}

  /// Adds a plane; its sigma is that of its returns.
  void Add(const Plane &plane) { planes_.push_back(plane); }

  /// Tells whether a return of the window belongs to a larger plane that meets
  /// a given one.
  bool Have(int i, const Plane &board) const;

  /// Removes such returns, of positions in the window that lie on a plane.
  std::vector<int> Without(const std::vector<int> &inliers, const Plane &board) const;

 private:
  Eigen::Vector3d Smoothed(int i) const;

  const Window &window_;
  std::vector<Plane> planes_;
};

}  // namespace atom_core

#endif  // ATOM_CORE_CPP_LARGER_PLANES_H_
