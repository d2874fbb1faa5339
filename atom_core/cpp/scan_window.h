/// \file
/// The returns of a scan around a seed, sorted by layer and azimuth.

#ifndef ATOM_CORE_CPP_SCAN_WINDOW_H_
#define ATOM_CORE_CPP_SCAN_WINDOW_H_

#include <Eigen/Core>
#include <vector>

#include "atom_core/board_segmentation.h"
#include "atom_core/scan_layers.h"

namespace atom_core {

/// A return near the seed; azimuth counted from the seed's.
struct Near {
  const ScanPoint* point;
  double azimuth;
};

/// The returns around a board, layer by layer, by azimuth.
struct Window {
  std::vector<Near> points;
  std::vector<int> sphere;  ///< positions in points of those around the seed

  const ScanPoint& At(int i) const { return *points[i].point; }
};

/// Returns an angle between -pi and pi [rad].
double Wrapped(double angle);

/// Returns the azimuth of a position in the sensor's frame [rad].
double Azimuth(const Scan& scan, const Eigen::Vector3d& position);

/// Returns what is near enough to the seed to belong to a board there or to its surroundings.
Window CutWindow(const Scan& scan, const Eigen::Vector3d& seed, const BoardOptions& options);

}  // namespace atom_core

#endif  // ATOM_CORE_CPP_SCAN_WINDOW_H_
