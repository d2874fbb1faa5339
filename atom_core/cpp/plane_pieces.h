/// \file
/// Connected pieces of a plane: runs of returns along the layers, joined from layer to layer.

#ifndef ATOM_CORE_CPP_PLANE_PIECES_H_
#define ATOM_CORE_CPP_PLANE_PIECES_H_

#include <vector>

#include "scan_plane.h"
#include "scan_window.h"

namespace atom_core {

/// Neighbouring inliers of one layer, first and last position in the window.
struct Run {
  int layer, first, last;
  double from, to;  ///< azimuths
};

/// Finds the runs of a plane's inliers.
///
/// \param scan the cloud.
/// \param window the returns.
/// \param inliers positions in the window, ascending.
/// \param plane on which they lie.
/// \param reach a run bridges no gap that is longer [m].
/// \param dark gaps without returns that are shorter are dark squares [m].
std::vector<Run> FindRuns(const Scan& scan, const Window& window, const std::vector<int>& inliers,
                          const Plane& plane, double reach, double dark);

/// Returns the pieces of a plane: inliers whose runs overlap from one layer to the next. Larger
/// pieces first; the arguments are those of FindRuns.
std::vector<std::vector<int>> FindPieces(const Scan& scan, const Window& window,
                                         const std::vector<int>& inliers, const Plane& plane,
                                         double reach, double dark);

}  // namespace atom_core

#endif  // ATOM_CORE_CPP_PLANE_PIECES_H_
