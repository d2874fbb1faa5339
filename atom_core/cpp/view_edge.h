/// \file
/// Where a sensor's field of view ends, told by the cloud itself.
///
/// Nothing returns from beyond the edge of a field of view, but nothing returns from the sky,
/// either. An edge shows itself by going on beside what it cuts: at a line along which the returns
/// of a board and of what is on both sides of it end alike. The edge of a lens, of a cone of beams
/// and of a band of elevations are circles on the sphere of directions: planes, n . d = level.

#ifndef ATOM_CORE_CPP_VIEW_EDGE_H_
#define ATOM_CORE_CPP_VIEW_EDGE_H_

#include <Eigen/Core>
#include <vector>

#include "atom_core/scan_layers.h"
#include "plane_points.h"

namespace atom_core {

/// A circle of directions d beyond which a sensor sees nothing: normal . d > level.
struct ViewEdge {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitX();
  double level = 1.0;
};

/// What a sensor sees of a plane.
struct View {
  PlaneAxes axes;
  std::vector<ViewEdge> edges;
  double margin = 0.0;  ///< about an edge, where nobody knows [rad]

  /// Tells whether a place of the plane is surely in the field of view.
  bool Sees(const Eigen::Vector2d& place) const;
};

/// Finds the edges of the field of view that cut a piece of a plane.
///
/// \param scan the whole cloud.
/// \param axes of the plane, in the middle of the piece.
/// \param diagonal of the board [m].
/// \param spacing of the points of the piece [m].
View FindView(const Scan& scan, const PlaneAxes& axes, double diagonal, double spacing);

}  // namespace atom_core

#endif  // ATOM_CORE_CPP_VIEW_EDGE_H_
