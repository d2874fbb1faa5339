/// \file
/// Where a rectangle of known size lies in a plane, from what beams say about its outline.

#ifndef ATOM_CORE_BOARD_RECTANGLE_H_
#define ATOM_CORE_BOARD_RECTANGLE_H_

#include <Eigen/Core>
#include <vector>

namespace atom_core {

using PlanePoints = std::vector<Eigen::Vector2d>;

/// What beams say about the outline of a board, in its plane [m].
struct Outline {
  PlanePoints limits;   ///< on the border: half a beam beyond the outermost returns
  PlanePoints inside;   ///< returns from the board
  PlanePoints outside;  ///< where beams passed through the plane
};

/// A rectangle in the plane.
struct RectanglePose {
  double angle = 0.0;                                ///< of its first side [rad]
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();  ///< [m]
  double cost = 0.0;                                 ///< sum of the squared, limited misfits [m^2]

  /// Returns a point of the plane in the rectangle's own axes, from its middle.
  Eigen::Vector2d ToBoard(const Eigen::Vector2d& point) const;
};

/// Returns the distance of a point, in the rectangle's axes, to its border; negative inside.
double SignedDistance(const Eigen::Vector2d& point, const Eigen::Vector2d& half_size);

/// Fits a rectangle of known size: limits on its border, the others on the right side of it.
///
/// \param outline the evidence; needs some limits or inside points.
/// \param half_size half of width and height [m].
RectanglePose FitRectangle(const Outline& outline, const Eigen::Vector2d& half_size);

/// Moves a fitted rectangle to the middle of where the evidence allows it: layers that run along a
/// side do not tell where the board ends across them.
RectanglePose InMiddle(const Outline& outline, const Eigen::Vector2d& half_size,
                       RectanglePose pose);

/// Measures width and height from the limits on opposite sides of a fitted rectangle.
///
/// \param sigma if given, gets how certain they are [m], by the scatter of the limits.
/// \return (2,) [m]; NaN for a direction in which fewer than `least` limits are on one of the
/// sides.
Eigen::Vector2d MeasureSize(const PlanePoints& limits, const RectanglePose& pose,
                            const Eigen::Vector2d& half_size, Eigen::Vector2d* sigma = nullptr,
                            int least = 3);

}  // namespace atom_core

#endif  // ATOM_CORE_BOARD_RECTANGLE_H_
