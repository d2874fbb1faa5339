/// \file
/// Points of a plane without scan layers: how far apart they are, and which hang together.

#ifndef ATOM_CORE_CPP_PLANE_POINTS_H_
#define ATOM_CORE_CPP_PLANE_POINTS_H_

#include <Eigen/Core>
#include <vector>

#include "atom_core/board_rectangle.h"
#include "scan_plane.h"
#include "scan_window.h"

namespace atom_core {

constexpr double kRightBehind = 0.05;  // [m] beyond a plane's threshold: what tells how dense it is

/// Axes in a plane; the third one is its normal.
struct PlaneAxes {
  Plane plane;
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();

  PlaneAxes() = default;
  /// Takes the origin from a point near the plane.
  PlaneAxes(const Plane& plane, const Eigen::Vector3d& near);

  Eigen::Vector2d InPlane(const Eigen::Vector3d& point) const {
    return axes.leftCols<2>().transpose() * (point - origin);
  }
  Eigen::Vector3d InSpace(const Eigen::Vector2d& point) const {
    return origin + axes.leftCols<2>() * point;
  }
};

/// Side of the squares of InliersOf, of the board's shorter side.
constexpr double kSquareShare = 0.08;

/// How far neighbouring points are apart, from place to place: s = exp(level + slope . p). A square
/// of the side s holds one point on average; where points stand in lines, s follows the gaps
/// between the lines.
struct Spacing {
  double level = 0.0;
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();

  double At(const Eigen::Vector2d& point) const { return std::exp(level + slope.dot(point)); }
};

/// Estimates the spacing of points in a plane, at least three of them.
///
/// \param points the points [m].
/// \param reach gaps that are longer are none between neighbours [m].
Spacing EstimateSpacing(const PlanePoints& points, double reach);

/// Returns positions of points of which no two share a square of the side `pixel` [m].
std::vector<int> Thinned(const PlanePoints& points, double pixel);

/// Returns the area of the squares that hold points, and whose four neighbours do [m^2]: strips
/// that are narrower than three of them have none.
double CoreArea(const PlanePoints& points, double pixel);

/// Returns the positions of a window on a plane, without those where more returns are right behind
/// it than on it: a wall behind a board scatters into the board's plane.
///
/// \param threshold distance from the plane [m].
/// \param cell side of the squares in which returns are counted [m].
std::vector<int> InliersOf(const Window& window, const PlaneAxes& axes, double threshold,
                           double cell);

/// Returns the pieces of a plane in a window, positions in the window, the largest piece first.
///
/// \param window the returns.
/// \param inliers positions on the plane.
/// \param axes of the plane.
/// \param size of the board [m]; what is farther apart than a tenth of it, or than twice the
///   spacing, is apart.
std::vector<std::vector<int>> ConnectedPieces(const Window& window, const std::vector<int>& inliers,
                                              const PlaneAxes& axes, const Eigen::Vector2d& size);

/// Measures the sides of a piece, the longer one first [m]: the smallest box about its points.
///
/// \param angle if given, gets the direction of one of the sides [rad].
Eigen::Vector2d MeasurePiece(const PlanePoints& points, double spacing, double* angle = nullptr);

}  // namespace atom_core

#endif  // ATOM_CORE_CPP_PLANE_POINTS_H_
