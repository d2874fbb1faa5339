#include "logic/data_ages.h"

namespace atom_rviz {

void DataAges::note(const atom_calibration::CollectorState& state, double clock_s) {
  for (const auto& sensor : state.sensors) {
    const auto known = newest_.find(sensor.name);
    if (known != newest_.end() && known->second.first == sensor.stamp) continue;
    newest_[sensor.name] = {sensor.stamp, clock_s};
  }
}

std::map<std::string, double> DataAges::at(double clock_s) const {
  std::map<std::string, double> ages_s;
  for (const auto& [name, newest] : newest_) ages_s[name] = clock_s - newest.second;
  return ages_s;
}

}  // namespace atom_rviz
