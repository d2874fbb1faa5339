// The tool that tells a LiDAR's labeler where the board is.
#pragma once

#ifndef Q_MOC_RUN
#include <atom_calibration/CollectorState.h>
#include <ros/ros.h>
#endif

#include "plugins/cloud_tool.h"
#include "plugins/service_calls.h"

namespace rviz {
class StringProperty;
}

namespace atom_rviz {

/// A click on a point of a cloud sets the seed of its sensor, by the service /SENSOR/set_seed.
///
/// Which sensor a cloud belongs to is known from /collect_data/state, or set by a property.
class SeedTool : public CloudTool {
  Q_OBJECT
 public:
  SeedTool();

  void onInitialize() override;
  void activate() override;
  void deactivate() override;
  int processMouseEvent(rviz::ViewportMouseEvent& event) override;

 private:
  void click(const rviz::ViewportMouseEvent& event);
  void set_seed(const std::string& sensor, const Eigen::Vector3d& point_in_cloud);

  rviz::StringProperty* sensor_;
  ros::Subscriber subscriber_;
  atom_calibration::CollectorState state_;
  ServiceCalls services_;
};

}  // namespace atom_rviz
