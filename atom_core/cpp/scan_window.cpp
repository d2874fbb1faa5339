#include "scan_window.h"

#include <algorithm>
#include <cmath>

namespace atom_core {

double Wrapped(double angle) { return std::remainder(angle, 2.0 * M_PI); }

double Azimuth(const Scan& scan, const Eigen::Vector3d& position) {
  const Eigen::Vector3d in_spin = scan.sensor_R_spin.transpose() * position;
  return std::atan2(in_spin.y(), in_spin.x());
}

Window CutWindow(const Scan& scan, const Eigen::Vector3d& seed, const BoardOptions& options) {
  const double sphere = SeedRadius(options), radius = sphere + options.size.norm();
  const double distance = seed.norm(), seed_azimuth = Azimuth(scan, seed);
  // The cone about the seed's direction that the ball of the window fills.
  const double sine = std::min(radius / std::max(distance, 1e-9), 1.0);
  const double cosine = sine < 1.0 ? std::sqrt(1.0 - sine * sine) : -1.0;
  Window window;
  for (const ScanPoint& point : scan.points) {
    if (point.position.dot(seed) < cosine * distance * point.range) continue;
    window.points.push_back({&point, Wrapped(point.azimuth - seed_azimuth)});
  }
  std::sort(window.points.begin(), window.points.end(), [](const Near& a, const Near& b) {
    if (a.point->layer != b.point->layer) return a.point->layer < b.point->layer;
    return a.azimuth != b.azimuth ? a.azimuth < b.azimuth : a.point->index < b.point->index;
  });
  for (std::size_t i = 0; i < window.points.size(); ++i) {
    if ((window.points[i].point->position - seed).norm() < sphere) window.sphere.push_back(i);
  }
  return window;
}

}  // namespace atom_core
