// What the tools on clouds have in common.
#pragma once

#include <OgreQuaternion.h>
#include <OgreVector3.h>
#include <rviz/tool.h>

#include <optional>
#include <string>
#include <vector>

#include "logic/point_picking.h"
#include "plugins/cloud_watcher.h"

namespace rviz {
class RosTopicProperty;
class ViewportMouseEvent;
}  // namespace rviz

namespace atom_rviz {

/// A tool on the points of the clouds that are shown. The camera moves as ever with the middle and
/// the right button and the wheel, and with Alt and the left one.
class CloudTool : public rviz::Tool {
  Q_OBJECT
 public:
  CloudTool();

  void onInitialize() override;
  void activate() override {}
  void deactivate() override {}

 protected:
  /// The clouds to choose from.
  std::vector<ShownCloud> clouds() const;

  /// How a cloud is drawn in the view of an event; none while its frame is unknown.
  std::optional<Projection> projection_of(const sensor_msgs::PointCloud2& cloud,
                                          const rviz::ViewportMouseEvent& event) const;

  /// Pose of a cloud in the fixed frame: at its stamp, or the newest where that is too old.
  bool pose_of(const sensor_msgs::PointCloud2& cloud, Ogre::Vector3& position,
               Ogre::Quaternion& orientation) const;

  /// Whether the event is for the camera; it then got it.
  bool is_for_camera(rviz::ViewportMouseEvent& event) const;

 private:
  rviz::RosTopicProperty* topic_;
  CloudWatcher* watcher_ = nullptr;
};

/// The place of a mouse event in the view: the centre of the screen pixel. RViz counts those that
/// it draws, of which a dense screen has several for one of Qt's.
Point2 place_of(const rviz::ViewportMouseEvent& event);

/// How many screen pixels a pixel of Qt's is wide: 2, say, on a dense screen.
double screen_pixels(const rviz::ViewportMouseEvent& event);

}  // namespace atom_rviz
