// The tool that labels points of clouds.
#pragma once

#include <array>

#ifndef Q_MOC_RUN
#include <ros/ros.h>
#endif

#include "plugins/cloud_tool.h"

namespace Ogre {
class ManualObject;
class SceneNode;
}  // namespace Ogre

namespace rviz {
class EnumProperty;
class FloatProperty;
}  // namespace rviz

namespace atom_rviz {

/// A rectangle is dragged over points, which are then published as labels on ATOM's topics:
/// /rviz/selected_points, selected_border_points, selected_remove_points,
/// selected_clear_all_points.
///
/// With ATOM's keys p, b, r, c after dragging; or at once, by the property "On drag", by Shift
/// (border) and Ctrl (remove).
class PointLabelTool : public CloudTool {
  Q_OBJECT
 public:
  PointLabelTool();
  ~PointLabelTool() override;

  void onInitialize() override;
  void activate() override;
  void deactivate() override;
  void update(float wall_dt, float ros_dt) override;
  int processMouseEvent(rviz::ViewportMouseEvent& event) override;
  int processKeyEvent(QKeyEvent* event, rviz::RenderPanel* panel) override;

  /// Nothing is chosen any more: what is shown is another collection.
  void forget();

 private:
  enum Label { kInside, kBorder, kRemove, kClear, kNothing };
  struct Chosen {
    ShownCloud shown;
    std::vector<std::uint32_t> indices;
  };

  void finish(rviz::ViewportMouseEvent& event);
  void choose(rviz::ViewportMouseEvent& event, const Rectangle& rectangle);
  void publish(Label label);
  void highlight();
  void add_marks(const Chosen& chosen);
  void take_highlight_away();
  void say_what_is_chosen();
  Label label_of_drag(rviz::ViewportMouseEvent& event) const;
  void change_tool(char shortcut);

  rviz::EnumProperty* on_drag_;
  rviz::FloatProperty* depth_window_m_;
  std::array<ros::Publisher, 4> publishers_;
  std::vector<Chosen> chosen_;
  QString marked_frame_;
  Ogre::ManualObject* marks_ = nullptr;
  Ogre::SceneNode* node_ = nullptr;
  bool dragging_ = false;
  int from_x_ = 0;
  int from_y_ = 0;
};

}  // namespace atom_rviz
