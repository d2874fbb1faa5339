#pragma once

#include <string>

namespace atom_rviz {

/// The name of a sensor in the names of its topics and services: `_` for `-`, `.` and whatever else
/// ROS refuses there. Python has the same rule (atom_calibration/runtime/graph_names.py).
std::string graph_name(const std::string& name);

}  // namespace atom_rviz
