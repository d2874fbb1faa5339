/// \file
/// Planes among the returns of a window.

#ifndef ATOM_CORE_CPP_SCAN_PLANE_H_
#define ATOM_CORE_CPP_SCAN_PLANE_H_

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <vector>

#include "scan_window.h"

namespace atom_core {

constexpr double kThreshold = 3.0;     // standard deviations of inliers
constexpr double kApart = 4.0;         // standard deviations of ranges of something else, but
constexpr double kLeastApart = 0.03;   // [m] at least
constexpr double kLeastCosine = 0.14;  // of the incidence, 82 degrees

/// n . p = distance with n pointing away from the sensor.
struct Plane {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitX();
  double distance = 0.0;
  double sigma = 0.01;  ///< standard deviation of the returns about it [m]

  double Residual(const Eigen::Vector3d& point) const { return normal.dot(point) - distance; }
  /// Tells whether a return lies on the plane, to three standard deviations.
  bool Holds(const ScanPoint& point) const {
    return std::abs(Residual(point.position)) < kThreshold * sigma;
  }
  /// Returns 1 for a return clearly behind the plane, along its beam, -1 for one clearly before it.
  int Side(const ScanPoint& point) const {
    const double cosine = normal.dot(point.position) / point.range;
    if (cosine < 1e-3) return -1;  // the beam does not meet the plane
    const double beyond = point.range - distance / cosine;
    const double apart = std::max(kLeastApart, kApart * sigma / cosine);
    return beyond > apart ? 1 : beyond < -apart ? -1 : 0;
  }
};

/// Fits a plane to some positions in the window; its sigma is that of the median residual.
Plane FitPlane(const Window& window, const std::vector<int>& chosen);

/// Returns those positions among the given ones that are nearer to a plane than a threshold [m].
std::vector<int> OnPlane(const Window& window, const std::vector<int>& among, const Plane& plane,
                         double threshold);

/// Returns those positions among the given ones that are not.
std::vector<int> OffPlane(const Window& window, const std::vector<int>& among, const Plane& plane,
                          double threshold);

/// Inliers of a plane that is proposed for a board lie this near to it, in standard deviations.
constexpr double kProposal = 2.0;

/// Finds the plane with the most points among those given (RANSAC), refit to them.
///
/// \param window the returns.
/// \param among positions that take part.
/// \param threshold of inliers [m].
/// \param least_distance planes that pass nearer to the sensor are none [m].
/// \param plane the result.
/// \return whether there is one.
bool ProposePlane(const Window& window, const std::vector<int>& among, double threshold,
                  double least_distance, Plane* plane);

}  // namespace atom_core

#endif  // ATOM_CORE_CPP_SCAN_PLANE_H_
