/// \file
/// What is seen of a rectangle, cell by cell, and beside it.

#ifndef ATOM_CORE_CPP_CLOUD_FILLING_H_
#define ATOM_CORE_CPP_CLOUD_FILLING_H_

#include <Eigen/Core>
#include <vector>

#include "plane_points.h"
#include "rectangle_sides.h"

namespace atom_core {

/// Shares of those cells of a rectangle that are in view.
struct CellShares {
  double there = 0.0;     ///< with a point of the plane
  double nearer = 0.0;    ///< without, and with something nearer to the sensor's origin
  double farther = 0.0;   ///< without, and with something farther
  double enclosed = 0.0;  ///< with nothing, between cells with points: surfaces that swallow light
  double in_view = 1.0;   ///< of all cells
};

/// Looks at the cells of a rectangle, two spacings wide.
///
/// \param scan the whole cloud.
/// \param view of the plane.
/// \param pose of the rectangle.
/// \param half half its sides [m].
/// \param spacing the widest on the rectangle [m].
/// \param sides those of the rectangle; bins beside which something nearer is are marked hidden.
CellShares LookAtCells(const Scan& scan, const View& view, const RectanglePose& pose,
                       const Eigen::Vector2d& half, double spacing, Sides* sides);

}  // namespace atom_core

#endif  // ATOM_CORE_CPP_CLOUD_FILLING_H_
