#include "scan_window.h"

#include <algorithm>
#include <cmath>

namespace atom_core {

double Wrapped(double angle) {
  return std::abs(angle) <= M_PI ? angle : std::remainder(angle, 2.0 * M_PI);
}

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
  // Of the azimuth, the cone takes more the nearer it is to the spin axis.
  const double height = std::abs(scan.sensor_R_spin.col(2).dot(seed)) / std::max(distance, 1e-9);
  const double level = std::sqrt(std::max(1.0 - height * height, 0.0));
  const double reach = sine < 0.999 * level ? std::asin(sine / level) + 1e-6 : M_PI;
  Window window;
  for (std::size_t k = 0; k + 1 < scan.layer_begin.size(); ++k) {
    const auto begin = scan.by_azimuth.begin() + scan.layer_begin[k],
               end = scan.by_azimuth.begin() + scan.layer_begin[k + 1];
    const auto size = end - begin;
    auto i =
        std::lower_bound(begin, end, Wrapped(seed_azimuth - reach),
                         [&](int a, double azimuth) { return scan.points[a].azimuth < azimuth; });
    for (auto count = size; count > 0; --count, ++i) {
      if (i == end) i = begin;
      const ScanPoint& point = scan.points[*i];
      const double azimuth = Wrapped(point.azimuth - seed_azimuth);
      if (std::abs(azimuth) > reach + 1e-9) break;
      if (point.position.dot(seed) < cosine * distance * point.range) continue;
      window.points.push_back({&point, azimuth});
    }
  }
  for (std::size_t i = 0; i < window.points.size(); ++i) {
    if ((window.points[i].point->position - seed).norm() < sphere) window.sphere.push_back(i);
  }
  return window;
}

}  // namespace atom_core
