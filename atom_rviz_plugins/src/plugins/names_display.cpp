#include "plugins/names_display.h"

#include <OgreCamera.h>
#include <OgreSceneManager.h>
#include <OgreSceneNode.h>
#include <OgreViewport.h>
#include <rviz/display_context.h>
#include <rviz/frame_manager.h>
#include <rviz/ogre_helpers/movable_text.h>
#include <rviz/properties/int_property.h>
#include <rviz/properties/ros_topic_property.h>
#include <rviz/render_panel.h>
#include <rviz/view_manager.h>
#include <rviz/window_manager_interface.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <pluginlib/class_list_macros.hpp>
#include <vector>

#include "logic/label_places.h"
#include "plugins/fitted_window.h"

namespace atom_rviz {
namespace {

constexpr double kLetterShare = 0.55;  // width of a letter by its height
constexpr double kLine = 1.15;         // height of a line by that of its letters
const Ogre::ColourValue kDark(0.08f, 0.08f, 0.09f);
const std::array<std::pair<float, float>, 4> kRim = {  // in screen pixels, beside the text
    {{-1.2f, 0.0f}, {1.2f, 0.0f}, {0.0f, -1.2f}, {0.0f, 1.2f}}};
const char kBeside[] = "  ";  // between the place and its name

}  // namespace

NamesDisplay::NamesDisplay() {
  topic_ = new rviz::RosTopicProperty("Topic", "", "visualization_msgs/MarkerArray",
                                      "Markers whose texts are shown.", this, SLOT(update_topic()));
  size_px_ = new rviz::IntProperty("Size", 17, "Height of a line on the screen, in pixels.", this);
  size_px_->setMin(6);
}

NamesDisplay::~NamesDisplay() {
  subscriber_.shutdown();
  clear();
}

// A layout may have names without the panel, which sees to the window else.
void NamesDisplay::onInitialize() {
  rviz::WindowManagerInterface* manager = context_->getWindowManager();
  QWidget* parent = manager ? manager->getParentWindow() : nullptr;
  if (parent) fit_into_screen(parent->window());
}

void NamesDisplay::setTopic(const QString& topic, const QString& /*datatype*/) {
  topic_->setString(topic);
}

void NamesDisplay::onEnable() { update_topic(); }

void NamesDisplay::onDisable() {
  subscriber_.shutdown();
  clear();
}

void NamesDisplay::reset() {
  rviz::Display::reset();
  update_topic();  // what is latched comes again
}

void NamesDisplay::update_topic() {
  subscriber_.shutdown();
  clear();
  const std::string topic = topic_->getTopicStd();
  if (!isEnabled() || topic.empty()) return;
  try {
    subscriber_ = update_nh_.subscribe(topic, 5, &NamesDisplay::take, this);
    setStatus(rviz::StatusProperty::Ok, "Topic", "OK");
  } catch (const ros::Exception& error) {
    setStatus(rviz::StatusProperty::Error, "Topic", error.what());
  }
}

// Runs in the window's thread.
void NamesDisplay::take(const visualization_msgs::MarkerArrayConstPtr& message) {
  for (const visualization_msgs::Marker& marker : message->markers) {
    if (marker.action == visualization_msgs::Marker::DELETEALL) {
      clear();
    } else if (marker.action == visualization_msgs::Marker::DELETE) {
      forget({marker.ns, marker.id});
    } else if (marker.type == visualization_msgs::Marker::TEXT_VIEW_FACING) {
      show(marker);
    }
  }
}

void NamesDisplay::show(const visualization_msgs::Marker& marker) {
  Name& name = names_[{marker.ns, marker.id}];
  name.marker = marker;
  const Ogre::ColourValue colour(marker.color.r, marker.color.g, marker.color.b, 1.0f);
  const std::string words = kBeside + marker.text;
  if (!name.node) {
    name.node = scene_node_->createChildSceneNode();
    for (std::size_t i = 0; i < kRim.size(); ++i) {
      name.rim.push_back(make_text(words, true));
      name.node->createChildSceneNode()->attachObject(name.rim.back().get());
    }
    name.text = make_text(words, false);
    name.node->createChildSceneNode()->attachObject(name.text.get());  // all have one name
  }
  for (const auto& rim : name.rim) rim->setCaption(words);
  name.text->setCaption(words);
  name.text->setColor(colour);
}

std::unique_ptr<rviz::MovableText> NamesDisplay::make_text(const std::string& words, bool rim) {
  auto text = std::make_unique<rviz::MovableText>(words, "Liberation Sans", 1.0f, kDark);
  text->setTextAlignment(rviz::MovableText::H_LEFT, rviz::MovableText::V_CENTER);
  text->showOnTop();
  text->setRenderQueueGroup(Ogre::RENDER_QUEUE_OVERLAY - (rim ? 2 : 1));
  return text;
}

void NamesDisplay::forget(const Key& key) {
  const auto found = names_.find(key);
  if (found == names_.end()) return;
  if (found->second.node) {
    found->second.rim.clear();
    found->second.text.reset();
    found->second.node->removeAndDestroyAllChildren();
    scene_manager_->destroySceneNode(found->second.node);
  }
  names_.erase(found);
}

void NamesDisplay::clear() {
  while (!names_.empty()) forget(names_.begin()->first);
}

void NamesDisplay::update(float /*wall_dt*/, float /*ros_dt*/) {
  const rviz::RenderPanel* panel = context_->getViewManager()->getRenderPanel();
  const Ogre::Camera* camera = panel ? panel->getCamera() : nullptr;
  const Ogre::Viewport* viewport = camera ? camera->getViewport() : nullptr;
  if (!viewport) return;
  const double width = viewport->getActualWidth();
  const double height = viewport->getActualHeight();
  const double line_px = size_px_->getInt() * (width / std::max(panel->width(), 1));  // of screen
  std::vector<Name*> seen;
  std::vector<ScreenLabel> labels;
  std::vector<float> metres;  // of a line
  std::vector<double> aside;  // to the left, in screen pixels
  for (auto& entry : names_) {
    Name& name = entry.second;
    Ogre::Vector3 place;
    Ogre::Quaternion turned;
    const bool known = context_->getFrameManager()->transform(
        name.marker.header.frame_id, ros::Time(), name.marker.pose, place, turned);
    name.node->setVisible(known);
    if (!known) continue;
    const Ogre::Vector3 in_camera = camera->getViewMatrix(true) * place;
    const bool ahead = in_camera.z < 0.0f;  // false of a place that is no number
    name.node->setVisible(ahead);
    if (!ahead) continue;
    const Ogre::Matrix4 projection = camera->getProjectionMatrix();  // also of a view without depth
    const Ogre::Vector3 on_screen = projection * in_camera;
    const Ogre::Vector3 above = projection * (in_camera + Ogre::Vector3::UNIT_Y);
    const double metre_px = (above.y - on_screen.y) / 2.0 * height;
    const double line_m = line_px / metre_px;
    name.node->setPosition(place);
    name.node->setScale(Ogre::Vector3(static_cast<float>(line_m)));
    seen.push_back(&name);
    metres.push_back(static_cast<float>(line_m));
    const double letters = static_cast<double>(name.marker.text.size()) + sizeof(kBeside);
    const double wide = letters * kLetterShare * line_px;
    const double at = (on_screen.x + 1.0) / 2.0 * width;
    const bool visible = at >= 0.0 && at <= width;
    aside.push_back(visible && at + wide > width ? wide : 0.0);  // else the view would cut it
    labels.push_back(
        {at - aside.back(), (1.0 - on_screen.y) / 2.0 * height, wide, kLine * line_px});
  }
  const std::vector<double> shifts = shifts_down(labels);
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const float pixel_m = metres[i] / static_cast<float>(line_px);
    const Ogre::Vector3 moved(-static_cast<float>(aside[i]) * pixel_m,
                              -static_cast<float>(shifts[i]) * pixel_m, 0.0f);
    seen[i]->text->setLocalTranslation(moved);
    for (std::size_t k = 0; k < kRim.size(); ++k) {
      seen[i]->rim[k]->setLocalTranslation(
          moved + pixel_m * Ogre::Vector3(kRim[k].first, kRim[k].second, 0.0f));
    }
  }
}

}  // namespace atom_rviz

PLUGINLIB_EXPORT_CLASS(atom_rviz::NamesDisplay, rviz::Display)
