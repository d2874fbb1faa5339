/// \file
/// A piece of a plane in a scan that may be a board, and what its returns and those beside it say.

#ifndef ATOM_CORE_CPP_BOARD_SURFACE_H_
#define ATOM_CORE_CPP_BOARD_SURFACE_H_

#include <Eigen/Core>
#include <cstddef>
#include <utility>
#include <vector>

#include "atom_core/board_rectangle.h"
#include "larger_planes.h"
#include "scan_plane.h"
#include "scan_window.h"

namespace atom_core {

/// What a search around one seed looks at.
struct BoardSearch {
  const Scan& scan;
  const Window& window;
  const BoardOptions& options;
  const LargerPlanes* larger = nullptr;  ///< that are known around the seed

  const ScanPoint& At(int i) const { return window.At(i); }
  Eigen::Vector2d HalfSize() const { return options.size / 2.0; }
  /// Tells whether a return on a plane belongs to a larger one that meets it.
  bool IsOfLarger(int i, const Plane& plane) const {
    return larger != nullptr && larger->Have(i, plane);
  }
};

/// A piece of a plane with axes in it. Returns are named by their position in the window; a side
/// is 1 for the next return of a layer, -1 for the one before.
class Surface {
 public:
  /// Fits the plane to a piece that is not empty. The search must outlive the surface.
  Surface(const BoardSearch& search, std::vector<int> piece);

  const std::vector<int>& piece() const { return piece_; }
  /// Returns first and last of the piece in each layer.
  const std::vector<std::pair<int, int>>& ends() const { return ends_; }
  const Plane& plane() const { return plane_; }
  /// Returns the middle of the piece, on the plane.
  const Eigen::Vector3d& origin() const { return origin_; }
  /// Returns the axes of the plane; the third is its normal.
  const Eigen::Matrix3d& axes() const { return axes_; }
  /// Returns half the size of the outline that the beams' middles trace.
  const Eigen::Vector2d& seen_half() const { return seen_half_; }
  /// Returns the angle of the beam to the middle with the normal [rad].
  double incidence() const { return incidence_; }

  /// Returns a point of the plane in its axes.
  Eigen::Vector2d InPlane(const Eigen::Vector3d& point) const {
    return axes_.leftCols<2>().transpose() * (point - origin_);
  }
  /// Finds where a beam meets the plane; false if it does not.
  bool Meets(const Eigen::Vector3d& direction, Eigen::Vector2d* in_plane) const {
    const double cosine = plane_.normal.dot(direction);
    if (cosine < 1e-3) return false;
    *in_plane = InPlane(direction * (plane_.distance / cosine));
    return true;
  }

  /// Returns a length on the board that one beam step spans, at the middle of the piece [m].
  double StepOnBoard() const;
  /// Returns the angle from half way to the layer below to half way to the one above [rad].
  ///
  /// \param i a return of the layer. Beyond the lowest and the highest one it is as on their other
  /// side.
  double LayerSpacing(int i) const;
  /// Returns how far the beam of a return is, where it meets the plane, from a layer above or below
  /// it [m]; the distance to the sensor if one of them does not meet it.
  double ToLayer(int i, double elevation) const;
  /// Returns how far a layer's end may be from the border [m].
  double Tolerance() const;

  /// Returns how far returns scatter about their neighbours, along layers and from layer to layer,
  /// as single lasers read long or short [m].
  double OwnScatter() const;
  /// Returns the piece without its lowest and highest layers of which more beams pass between their
  /// ends than return: posts that carry a board.
  std::vector<int> WithoutOpenEnds() const;
  /// Returns the piece without its lowest and highest layers of which more beams pass through than
  /// return where the next layer is on the surface: one post alone, and corners that point up or
  /// down.
  std::vector<int> WithoutNarrowEnds() const;

  /// Tells whether something nearer to the sensor begins beside an end of a layer.
  bool IsHiddenBeside(int i, int side) const;
  /// Tells whether the surface goes on beyond an end of a layer.
  bool GoesOn(int i, int side) const;
  /// Tells whether a return is between the board and what is beside it: off the plane, towards
  /// its neighbour.
  bool IsMixed(int i, int side) const;
  /// Returns the first return inwards of an end that is not off the plane, as weak returns at
  /// edges are.
  int Trusted(int i, int inwards) const;

  /// Adds what an end of a layer says about the outline.
  void AddEnd(int i, int side, Outline* outline) const;
  /// Adds where beams of the layers next above and below passed the plane.
  void AddLayersAround(PlanePoints* outside) const;

 private:
  const ScanPoint& At(int i) const { return search_->At(i); }
  // The next position in the layer, outwards of an end; -1 if none is beside it.
  int Neighbour(int i, int side) const;
  // The piece in some of its layers.
  std::vector<int> Between(std::ptrdiff_t low, std::ptrdiff_t high) const;
  bool PassesBeside(std::ptrdiff_t layer, std::ptrdiff_t other) const;
  Eigen::Vector2d Border(int i, int side) const;
  double BeyondEnd(int i, int side) const;
  void AddOutside(int i, int side, PlanePoints* outside) const;

  const BoardSearch* search_;
  std::vector<int> piece_;
  std::vector<std::pair<int, int>> ends_;
  Plane plane_;
  Eigen::Vector3d origin_;
  Eigen::Matrix3d axes_;
  Eigen::Vector2d seen_half_;
  double incidence_;
};

}  // namespace atom_core

#endif  // ATOM_CORE_CPP_BOARD_SURFACE_H_
