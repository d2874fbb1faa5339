// How long ago data of each sensor came, whatever their stamps say.
#pragma once

#include <atom_calibration/CollectorState.h>

#include <map>
#include <string>
#include <utility>

namespace atom_rviz {

/// Notices when the newest stamp of a sensor is another one, by a clock that always goes on.
class DataAges {
 public:
  /// Take note of the newest stamps at a time of that clock.
  void note(const atom_calibration::CollectorState& state, double clock_s);

  /// For how long the newest stamp of each sensor has been the same [s].
  std::map<std::string, double> at(double clock_s) const;

 private:
  std::map<std::string, std::pair<ros::Time, double>> newest_;  ///< stamp, and when it came
};

}  // namespace atom_rviz
