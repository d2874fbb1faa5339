// Which sensor of the calibration a displayed cloud belongs to.
#pragma once

#include <atom_calibration/CollectorState.h>

#include <string>

namespace atom_rviz {

/// Name of the LiDAR whose data a topic shows: its own topic, or one below it (TOPIC/labeled;
/// of several the nearest); else the only LiDAR with that frame. Empty when there is none, or more
/// than one.
std::string sensor_of_cloud(const atom_calibration::CollectorState& state, const std::string& topic,
                            const std::string& frame_id);

}  // namespace atom_rviz
