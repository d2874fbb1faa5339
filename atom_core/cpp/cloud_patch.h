/// \file
/// A piece of a plane in a cloud without scan layers: how large and how flat it is.

#ifndef ATOM_CORE_CPP_CLOUD_PATCH_H_
#define ATOM_CORE_CPP_CLOUD_PATCH_H_

#include <Eigen/Core>
#include <vector>

#include "board_surface.h"
#include "plane_points.h"

namespace atom_core {

/// A piece of a plane, and its points in it.
struct Patch {
  PlaneAxes axes;
  std::vector<int> piece;  // positions in the window
  PlanePoints points;      // the same
  Spacing spacing;
  double incidence = 0.0;
  Eigen::Vector2d half = Eigen::Vector2d::Zero();  // of the outline that beams trace
};

/// Lays axes into a plane at a piece of it, and measures the spacing.
Patch MakePatch(const BoardSearch& search, const Plane& plane, std::vector<int> piece);

/// Measures width and height of a piece: its longer side is that of the board [m].
Eigen::Vector2d SizeOfPiece(const Patch& patch, const BoardOptions& options);

/// Returns the scatter of points about a plane of their own among their neighbours [m]. Single
/// neighbours do not do: those of one laser read long or short alike.
double ScatterAmongNeighbours(const BoardSearch& search, const Patch& patch);

/// Returns about the largest distance of two points of a piece, and how wide it is across that [m].
Eigen::Vector2d RoughSize(const BoardSearch& search, const std::vector<int>& piece);

/// Returns the area that a piece fills, without its rim and the strips that hang on it [m^2].
double CoreOfPiece(const BoardSearch& search, const std::vector<int>& piece);

}  // namespace atom_core

#endif  // ATOM_CORE_CPP_CLOUD_PATCH_H_
