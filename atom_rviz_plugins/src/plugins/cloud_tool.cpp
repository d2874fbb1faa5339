#include "plugins/cloud_tool.h"

#include <OgreCamera.h>
#include <OgreMatrix4.h>
#include <OgreViewport.h>
#include <rviz/display_context.h>
#include <rviz/frame_manager.h>
#include <rviz/properties/ros_topic_property.h>
#include <rviz/render_panel.h>
#include <rviz/view_controller.h>
#include <rviz/viewport_mouse_event.h>

namespace atom_rviz {
namespace {

Eigen::Matrix4d from_ogre(const Ogre::Matrix4& matrix) {
  Eigen::Matrix4d result;
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) result(row, column) = matrix[row][column];
  }
  return result;
}

}  // namespace

Point2 place_of(const rviz::ViewportMouseEvent& event) { return {event.x + 0.5, event.y + 0.5}; }

double screen_pixels(const rviz::ViewportMouseEvent& event) {
  const int width = event.panel->width();
  return width > 0 ? static_cast<double>(event.viewport->getActualWidth()) / width : 1.0;
}

CloudTool::CloudTool() {
  topic_ = new rviz::RosTopicProperty(
      "Cloud topic", "", "sensor_msgs/PointCloud2",
      "Choose points of this cloud only. Empty: of all that are shown; where several have the same "
      "frame, of the largest.",
      getPropertyContainer());
}

void CloudTool::onInitialize() { watcher_ = new CloudWatcher(context_, this); }

std::vector<ShownCloud> CloudTool::clouds() const {
  return watcher_ ? watcher_->clouds(topic_->getTopicStd()) : std::vector<ShownCloud>();
}

bool CloudTool::pose_of(const sensor_msgs::PointCloud2& cloud, Ogre::Vector3& position,
                        Ogre::Quaternion& orientation) const {
  rviz::FrameManager* frames = context_->getFrameManager();
  return frames->getTransform(cloud.header, position, orientation) ||
         frames->getTransform(cloud.header.frame_id, ros::Time(), position, orientation);
}

std::optional<Projection> CloudTool::projection_of(const sensor_msgs::PointCloud2& cloud,
                                                   const rviz::ViewportMouseEvent& event) const {
  Ogre::Vector3 position;
  Ogre::Quaternion orientation;
  if (!pose_of(cloud, position, orientation)) return {};
  Ogre::Matrix4 world_T_cloud;
  world_T_cloud.makeTransform(position, Ogre::Vector3::UNIT_SCALE, orientation);
  const Ogre::Camera* camera = event.viewport->getCamera();
  Projection projection;
  projection.eye_T_cloud = from_ogre(camera->getViewMatrix(true)) * from_ogre(world_T_cloud);
  projection.clip_T_eye = from_ogre(camera->getProjectionMatrix());
  projection.widget = {static_cast<double>(event.viewport->getActualWidth()),
                       static_cast<double>(event.viewport->getActualHeight())};
  return projection;
}

bool CloudTool::is_for_camera(rviz::ViewportMouseEvent& event) const {
  const bool is_left = event.acting_button == Qt::LeftButton || event.left();
  if (event.wheel_delta == 0 && is_left && !event.alt()) return false;
  if (rviz::ViewController* controller = event.panel->getViewController()) {
    controller->handleMouseEvent(event);
  }
  return true;
}

}  // namespace atom_rviz
