#include "logic/sensor_of_cloud.h"

namespace atom_rviz {
namespace {

bool shows(const std::string& topic, const std::string& data_topic) {
  if (data_topic.empty()) return false;
  return topic == data_topic || topic.compare(0, data_topic.size() + 1, data_topic + "/") == 0;
}

/// Cameras show images; a seed in a depth image is a pixel.
bool has_image(const atom_calibration::SensorState& sensor) {
  return sensor.modality == "rgb" || sensor.modality == "depth";
}

}  // namespace

std::string sensor_of_cloud(const atom_calibration::CollectorState& state, const std::string& topic,
                            const std::string& frame_id) {
  std::string by_topic, by_frame;
  std::size_t longest = 0;  // of the topics that it may stand below, the nearest
  int of_frame = 0;
  for (const auto& sensor : state.sensors) {
    if (has_image(sensor)) continue;
    if (shows(topic, sensor.topic) && sensor.topic.size() > longest) {
      by_topic = sensor.name;
      longest = sensor.topic.size();
    }
    if (sensor.frame_id == frame_id) {
      by_frame = sensor.name;
      ++of_frame;
    }
  }
  if (!by_topic.empty()) return by_topic;
  return of_frame == 1 ? by_frame : "";
}

}  // namespace atom_rviz
