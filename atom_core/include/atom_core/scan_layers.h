/// \file
/// The layers of a spinning LiDAR's scan: which beams belong together, and where each one points.
///
/// The laser of one layer turns about the spin axis a and keeps its elevation e, so that its unit
/// directions d lie on a cone, a . d = sin(e). That holds in any orientation of the data frame.
/// With layers known (a ring field, the rows of an organised cloud), a is the eigenvector of the
/// smallest eigenvalue of the scatter of the directions within the layers. Without them a is
/// searched, as the axis about which the elevations fall into distinct groups.

#ifndef ATOM_CORE_SCAN_LAYERS_H_
#define ATOM_CORE_SCAN_LAYERS_H_

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "atom_core/planar_compression.h"  // PointRows

namespace atom_core {

/// A return of a scan; without layers azimuth, elevation and layer are zero.
struct ScanPoint {
  std::int64_t index;        ///< in the cloud as it was given
  Eigen::Vector3d position;  ///< in the sensor's frame [m]
  double range;              ///< from the sensor's origin [m]
  double azimuth;            ///< about the spin axis, -pi to pi [rad]
  double elevation;          ///< above the plane normal to the spin axis [rad]
  int layer;                 ///< 0 the lowest
};

/// A cloud as a scan. Invalid points are left out.
struct Scan {
  std::vector<ScanPoint> points;        ///< in the order of the cloud
  Eigen::Matrix3d sensor_R_spin;        ///< third column: the spin axis in the sensor's frame
  std::vector<double> layer_elevation;  ///< mean of each layer, ascending [rad]
  std::vector<int> by_azimuth;          ///< positions in points, by layer, azimuth and index
  std::vector<int> layer_begin;         ///< in by_azimuth, of each layer; and the end of the last
  double azimuth_step = 0.0;            ///< between neighbours in a layer [rad]
  bool has_layers = false;              ///< false: no axis gives distinct layers; none are here

  /// Returns the unit vector, in the sensor's frame, of a beam.
  Eigen::Vector3d Direction(double azimuth, double elevation) const;
};

/// How the points of a cloud stand in memory; any part may be unknown.
struct CloudLayout {
  std::vector<std::int64_t> ring;  ///< (n,) layer of each point; empty: unknown
  std::int64_t width = 0;          ///< points per row; with height > 1 an organised cloud
  std::int64_t height = 1;         ///< number of rows
};

/// Finds the layers of a cloud.
///
/// A ring field, the rows and the columns of an organised cloud are used when the directions agree
/// with them (drivers fill in zeros, or write columns as rows); otherwise elevations are grouped.
///
/// \param cloud (n, 3) in the sensor's frame, metres; NaN and points at the origin are invalid.
/// \param layout rings or organisation.
/// \throws std::invalid_argument when the lengths disagree.
Scan FindLayers(const Eigen::Ref<const PointRows>& cloud, const CloudLayout& layout);

}  // namespace atom_core

#endif  // ATOM_CORE_SCAN_LAYERS_H_
