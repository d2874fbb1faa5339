// A polygon while it is drawn into an image, corner by corner.
#pragma once

#include <vector>

#include "logic/image_view.h"

namespace atom_rviz {

/// Takes corners, closes, takes back or forgets. Corners are in px of the image.
class PolygonDrawing {
 public:
  enum class Outcome {
    kAdded,      ///< a corner more
    kClosed,     ///< `closed()` is the finished polygon; the next corner begins another one
    kTooSmall,   ///< fewer than three corners, or no area: nothing changed
    kTakenBack,  ///< a corner less
    kCancelled,  ///< nothing is being drawn any more
    kNothing     ///< there was nothing to do
  };

  /// Add a corner. Within `closing_radius_px` of the first one it closes instead, once there are
  /// three. A corner that repeats the last one, as a double click gives it, is nothing.
  Outcome add(Point2 corner, double closing_radius_px);

  Outcome close();
  Outcome take_back();
  Outcome cancel();

  const std::vector<Point2>& corners() const { return corners_; }
  const std::vector<Point2>& closed() const { return closed_; }

 private:
  std::vector<Point2> corners_;
  std::vector<Point2> closed_;
};

/// The area of a polygon in px^2, whichever way round; overlaps of opposite sense cancel.
double area_px2(const std::vector<Point2>& polygon);

}  // namespace atom_rviz
