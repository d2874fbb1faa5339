/// \file
/// The sides of a rectangle against points without scan layers.
///
/// Along each side, bins two spacings wide hold the outermost point on the plane. A board's edge
/// lies beyond it, by as much as lines that are drawn through the middle of the board lie beyond
/// the last points before them: about half a spacing, for points in rows and for strewn ones.

#ifndef ATOM_CORE_CPP_RECTANGLE_SIDES_H_
#define ATOM_CORE_CPP_RECTANGLE_SIDES_H_

#include <Eigen/Core>
#include <array>
#include <vector>

#include "plane_points.h"
#include "view_edge.h"

namespace atom_core {

/// A return near the plane of a board.
struct PlaneReturn {
  Eigen::Vector2d position;  ///< in the plane [m]
  double off;                ///< from the plane [m]
  int near;                  ///< position in the window
};

/// A part of a side.
struct SideBin {
  double along = 0.0;    ///< of its middle, from the middle of the side [m]
  double beyond = -1e9;  ///< of the outermost point on the plane, beyond the side [m]
  double inset = 0.0;    ///< of the outermost point that is to be expected [m]
  double spacing = 0.0;  ///< of the points there [m]
  int outermost = -1;    ///< its position among the returns
  int open = 0;          ///< points of the plane farther out: the surface goes on
  int touching = 0;      ///< points beside the side, before the plane: something touches it
  int behind = 0;        ///< the same right behind it: a wall
  bool hidden = false;   ///< something nearer to the sensor begins there
  bool in_view = true;   ///< the side is in the field of view there

  /// Tells whether the surface goes on beyond the side; a wall right behind scatters into its
  /// plane.
  bool GoesOn() const { return 2 * open > behind; }
  /// Tells whether the bin shows the edge of the board.
  bool OnBorder() const;
};

/// The four sides +x, -x, +y, -y.
using Sides = std::array<std::vector<SideBin>, 4>;

/// How a board is sampled.
struct Sampling {
  Spacing spacing;                  ///< of its points
  double sigma = 0.01;              ///< of the points about the plane [m]
  Eigen::Vector2d inset{0.5, 0.5};  ///< of outermost points before lines across x and y [spacings]
  View view;                        ///< of the plane
};

/// Measures the insets of points inside a rectangle, and widens the spacing by them: where points
/// gather in lines that cross, the gaps between them are wider than points are apart.
///
/// \param returns near the plane.
/// \param pose of the rectangle.
/// \param half half its sides [m].
/// \param spacing of the points to begin with.
/// \param sigma of the points about the plane [m].
/// \param view of the plane.
Sampling MeasureSampling(const std::vector<PlaneReturn>& returns, const RectanglePose& pose,
                         const Eigen::Vector2d& half, const Spacing& spacing, double sigma,
                         const View& view);

/// Looks along the sides of a rectangle.
Sides LookAlongSides(const std::vector<PlaneReturn>& returns, const RectanglePose& pose,
                     const Eigen::Vector2d& half, const Sampling& sampling);

/// Lays the rectangle on what its sides show, from a pose nearby.
RectanglePose RefineBySides(const std::vector<PlaneReturn>& returns, RectanglePose pose,
                            const Eigen::Vector2d& half, const Sampling& sampling);

/// Measured sides of a board, and how certain they are [m]; NaN where a side is not seen.
struct MeasuredSize {
  Eigen::Vector2d size, sigma;
};

/// Measures the distances of opposite sides.
MeasuredSize MeasureSides(const Sides& sides, const Eigen::Vector2d& half);

/// Returns the distance inside a side at which its points begin to be something else's [m].
double TouchMargin(const SideBin& bin, double sigma);

}  // namespace atom_core

#endif  // ATOM_CORE_CPP_RECTANGLE_SIDES_H_
