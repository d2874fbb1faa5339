#include "plugins/seed_tool.h"

#include <atom_calibration/SetSeed.h>
#include <rviz/properties/string_property.h>
#include <rviz/viewport_mouse_event.h>

#include <pluginlib/class_list_macros.hpp>
#include <stdexcept>

#include "logic/graph_name.h"
#include "logic/sensor_of_cloud.h"

namespace atom_rviz {
namespace {

constexpr double kRadius_px = 8.0;  // on a screen that is not dense

}  // namespace

SeedTool::SeedTool() {
  shortcut_key_ = 'd';
  sensor_ = new rviz::StringProperty(
      "Sensor", "",
      "Name of the sensor whose seed is set. Empty: the one that the cloud belongs to, which the "
      "collector tells on /collect_data/state.",
      getPropertyContainer());
}

void SeedTool::onInitialize() {
  CloudTool::onInitialize();
  setName("Set seed");
}

// Only while it is used: roscpp shares a subscription within a program, and one that lives on would
// keep the panel from subscribing anew when the master is restarted.
void SeedTool::activate() {
  subscriber_ = ros::NodeHandle().subscribe<atom_calibration::CollectorState>(
      "/collect_data/state", 1,
      [this](const atom_calibration::CollectorStateConstPtr& state) { state_ = *state; });
  setStatus("Click a point of the board in a cloud.");
}

void SeedTool::deactivate() { subscriber_.shutdown(); }

int SeedTool::processMouseEvent(rviz::ViewportMouseEvent& event) {
  if (is_for_camera(event)) return 0;
  if (event.leftDown()) click(event);
  return 0;
}

void SeedTool::click(const rviz::ViewportMouseEvent& event) {
  std::optional<PointHit> best;
  ShownCloud of_best;
  const double radius_px = kRadius_px * screen_pixels(event);
  for (const ShownCloud& shown : clouds()) {
    const std::optional<Projection> projection = projection_of(*shown.cloud, event);
    if (!projection) continue;
    try {
      const auto hit = point_at(*shown.cloud, *projection, place_of(event), radius_px);
      if (!hit || (best && !is_better(*hit, *best))) continue;
      best = hit;
      of_best = shown;
    } catch (const std::invalid_argument& error) {
      ROS_WARN_STREAM("Set seed: " << shown.topic << ": " << error.what());
    }
  }
  if (!best) {
    setStatus("There is no point of a cloud here.");
    return;
  }
  std::string sensor = sensor_->getStdString();
  if (sensor.empty()) {
    sensor = sensor_of_cloud(state_, of_best.topic, of_best.cloud->header.frame_id);
  }
  if (sensor.empty()) {
    setStatus(QString("Whose cloud is %1? The collector is not running; else set the property "
                      "'Sensor' of this tool (panel Tool Properties).")
                  .arg(QString::fromStdString(of_best.topic)));
    return;
  }
  set_seed(sensor, best->point);
}

void SeedTool::set_seed(const std::string& sensor, const Eigen::Vector3d& point_in_cloud) {
  atom_calibration::SetSeed service;
  service.request.position = {point_in_cloud.x(), point_in_cloud.y(), point_in_cloud.z()};
  const QString what = QString("Seed of %1 at %2, %3, %4 m")
                           .arg(QString::fromStdString(sensor))
                           .arg(point_in_cloud.x(), 0, 'f', 3)
                           .arg(point_in_cloud.y(), 0, 'f', 3)
                           .arg(point_in_cloud.z(), 0, 'f', 3);
  setStatus(what + "...");
  services_.call(
      "/" + graph_name(sensor) + "/set_seed", service,
      [this, what](bool success, const std::string& message) {
        setStatus(what + (success ? ". " : ": not set. ") + QString::fromStdString(message));
      });
}

}  // namespace atom_rviz

PLUGINLIB_EXPORT_CLASS(atom_rviz::SeedTool, rviz::Tool)
