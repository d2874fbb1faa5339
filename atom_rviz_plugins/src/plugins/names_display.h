// Names in the view that nothing hides.
#pragma once

#include <rviz/display.h>

#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#ifndef Q_MOC_RUN
#include <ros/ros.h>
#include <visualization_msgs/MarkerArray.h>
#endif

namespace Ogre {
class SceneNode;
}

namespace rviz {
class IntProperty;
class MovableText;
class RosTopicProperty;
}  // namespace rviz

namespace atom_rviz {

/// Shows the texts of a MarkerArray on top of all else, beside their places, in one size on the
/// screen, and none over another. Other markers are not shown.
class NamesDisplay : public rviz::Display {
  Q_OBJECT
 public:
  NamesDisplay();
  ~NamesDisplay() override;

  void onInitialize() override;
  void reset() override;
  void update(float wall_dt, float ros_dt) override;
  void setTopic(const QString& topic, const QString& datatype) override;

 protected:
  void onEnable() override;
  void onDisable() override;

 private Q_SLOTS:
  void update_topic();

 private:
  struct Name {
    visualization_msgs::Marker marker;
    Ogre::SceneNode* node = nullptr;
    std::unique_ptr<rviz::MovableText> text;
    std::vector<std::unique_ptr<rviz::MovableText>> rim;  // dark, so that it reads on any ground
  };
  using Key = std::pair<std::string, int>;

  void take(const visualization_msgs::MarkerArrayConstPtr& message);
  void show(const visualization_msgs::Marker& marker);
  std::unique_ptr<rviz::MovableText> make_text(const std::string& words, bool rim);
  void forget(const Key& key);
  void clear();

  rviz::RosTopicProperty* topic_;
  rviz::IntProperty* size_px_;
  ros::Subscriber subscriber_;
  std::map<Key, Name> names_;
};

}  // namespace atom_rviz
