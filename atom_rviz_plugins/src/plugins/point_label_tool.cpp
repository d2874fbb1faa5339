#include "plugins/point_label_tool.h"

#include <OgreManualObject.h>
#include <OgreMaterialManager.h>
#include <OgreRenderQueue.h>
#include <OgreResourceGroupManager.h>
#include <OgreSceneManager.h>
#include <OgreSceneNode.h>
#include <OgreTechnique.h>
#include <rviz/display_context.h>
#include <rviz/properties/enum_property.h>
#include <rviz/properties/float_property.h>
#include <rviz/selection/selection_manager.h>
#include <rviz/tool_manager.h>
#include <rviz/viewport_mouse_event.h>

#include <QKeyEvent>
#include <cstdlib>
#include <pluginlib/class_list_macros.hpp>
#include <stdexcept>

#include "logic/cloud_points.h"

namespace atom_rviz {
namespace {

constexpr std::array<const char*, 4> kTopics{
    "/rviz/selected_points", "/rviz/selected_border_points", "/rviz/selected_remove_points",
    "/rviz/selected_clear_all_points"};
constexpr std::array<const char*, 4> kNames{"inside", "border", "to be removed",
                                            "all labels cleared"};
constexpr int kClick_px = 3;   // less is no drag but a click
constexpr int kAround_px = 4;  // a click chooses what is so near
constexpr float kMark_px = 4.0f;
const char kMaterial[] = "atom_rviz_plugins/ChosenPoints";

/// What chosen points are drawn with: over everything, since the cloud is just as far away.
void make_material() {
  Ogre::MaterialManager& materials = Ogre::MaterialManager::getSingleton();
  if (materials.resourceExists(kMaterial)) return;
  Ogre::MaterialPtr material =
      materials.create(kMaterial, Ogre::ResourceGroupManager::DEFAULT_RESOURCE_GROUP_NAME);
  material->setReceiveShadows(false);
  Ogre::Pass* pass = material->getTechnique(0)->getPass(0);
  pass->setLightingEnabled(false);
  pass->setDepthCheckEnabled(false);
  pass->setDepthWriteEnabled(false);
  pass->setPointSize(kMark_px);
}

}  // namespace

PointLabelTool::PointLabelTool() {
  shortcut_key_ = 'l';
  access_all_keys_ = true;  // p and c are shortcuts of RViz's own tools
  on_drag_ = new rviz::EnumProperty(
      "On drag", "Select",
      "What happens to the points in the rectangle. Select: they are kept for the keys p (inside), "
      "b (border), r (remove), c (clear all labels of the cloud). Shift is always border, Ctrl "
      "remove.",
      getPropertyContainer());
  on_drag_->addOption("Select", kNothing);
  on_drag_->addOption("Inside", kInside);
  on_drag_->addOption("Border", kBorder);
  on_drag_->addOption("Remove", kRemove);
  depth_window_m_ = new rviz::FloatProperty(
      "Depth window", 0.0f,
      "Take only points that are at most so many metres behind the nearest one. 0: all of them.",
      getPropertyContainer());
  depth_window_m_->setMin(0.0f);
}

PointLabelTool::~PointLabelTool() {
  if (!node_) return;
  scene_manager_->destroyManualObject(marks_);
  scene_manager_->destroySceneNode(node_);
}

void PointLabelTool::onInitialize() {
  CloudTool::onInitialize();
  setName("Label points");
  make_material();
  marks_ = scene_manager_->createManualObject();
  marks_->setRenderQueueGroup(Ogre::RENDER_QUEUE_7);  // after the clouds
  node_ = scene_manager_->getRootSceneNode()->createChildSceneNode();
  node_->attachObject(marks_);
  ros::NodeHandle node;
  for (std::size_t i = 0; i < kTopics.size(); ++i) {
    publishers_[i] = node.advertise<sensor_msgs::PointCloud2>(kTopics[i], 5);
  }
}

void PointLabelTool::activate() {
  dragging_ = false;
  setStatus("Drag a rectangle over points. Shift: border, Ctrl: remove; keys p, b, r, c.");
}

void PointLabelTool::deactivate() {
  if (dragging_) context_->getSelectionManager()->removeHighlight();
  dragging_ = false;
  chosen_.clear();
  take_highlight_away();
}

// Marks lie in the fixed frame.
void PointLabelTool::update(float /*wall_dt*/, float /*ros_dt*/) {
  if (!chosen_.empty() && context_->getFixedFrame() != marked_frame_) highlight();
}

void PointLabelTool::forget() {
  if (chosen_.empty()) return;
  chosen_.clear();
  take_highlight_away();
  setStatus("");
}

int PointLabelTool::processMouseEvent(rviz::ViewportMouseEvent& event) {
  if (!dragging_ && is_for_camera(event)) return 0;
  rviz::SelectionManager* selection = context_->getSelectionManager();
  if (event.leftDown()) {
    dragging_ = true;
    from_x_ = event.x;
    from_y_ = event.y;
  }
  if (!dragging_) return 0;
  if (event.leftUp()) {
    dragging_ = false;
    selection->removeHighlight();
    finish(event);
  } else if (!event.left()) {
    dragging_ = false;  // released outside the window
    selection->removeHighlight();
  } else {
    selection->highlight(event.viewport, from_x_, from_y_, event.x, event.y);
  }
  return Render;
}

void PointLabelTool::finish(rviz::ViewportMouseEvent& event) {
  const double dense = screen_pixels(event), around_px = kAround_px * dense;
  const bool is_click = std::abs(event.x - from_x_) < kClick_px * dense &&
                        std::abs(event.y - from_y_) < kClick_px * dense;
  const Point2 to = place_of(event);
  Rectangle rectangle{{from_x_ + 0.5, from_y_ + 0.5}, to};
  if (is_click) {
    rectangle = {{to.x - around_px, to.y - around_px}, {to.x + around_px, to.y + around_px}};
  }
  choose(event, rectangle);
  highlight();
  const Label label = label_of_drag(event);
  if (label == kNothing || chosen_.empty()) {
    say_what_is_chosen();
  } else {
    publish(label);
  }
}

void PointLabelTool::choose(rviz::ViewportMouseEvent& event, const Rectangle& rectangle) {
  chosen_.clear();
  for (const ShownCloud& shown : clouds()) {
    const std::optional<Projection> projection = projection_of(*shown.cloud, event);
    if (!projection) continue;
    try {
      std::vector<std::uint32_t> indices =
          points_in_rectangle(*shown.cloud, *projection, rectangle, depth_window_m_->getFloat());
      if (!indices.empty()) chosen_.push_back({shown, std::move(indices)});
    } catch (const std::invalid_argument& error) {
      ROS_WARN_STREAM("Label points: " << shown.topic << ": " << error.what());
    }
  }
}

PointLabelTool::Label PointLabelTool::label_of_drag(rviz::ViewportMouseEvent& event) const {
  if (event.shift()) return kBorder;
  if (event.control()) return kRemove;
  return static_cast<Label>(on_drag_->getOptionInt());
}

void PointLabelTool::publish(Label label) {
  if (chosen_.empty()) {
    setStatus("Nothing is selected: drag a rectangle over points first.");
    return;
  }
  QString text;
  for (const Chosen& chosen : chosen_) {
    publishers_[label].publish(chosen_points(*chosen.shown.cloud, chosen.indices));
    text += QString("%1 points of %2: %3. ")
                .arg(chosen.indices.size())
                .arg(QString::fromStdString(chosen.shown.topic), kNames[label]);
  }
  setStatus(text);
}

void PointLabelTool::say_what_is_chosen() {
  if (chosen_.empty()) {
    setStatus(clouds().empty() ? "No cloud is shown: add a PointCloud2 or LaserScan display."
                               : "There are no points in the rectangle.");
    return;
  }
  QString text;
  for (const Chosen& chosen : chosen_) {
    text += QString("%1 points of %2. ")
                .arg(chosen.indices.size())
                .arg(QString::fromStdString(chosen.shown.topic));
  }
  setStatus(text + "p: inside, b: border, r: remove, c: clear all labels.");
}

int PointLabelTool::processKeyEvent(QKeyEvent* event, rviz::RenderPanel* /*panel*/) {
  switch (event->key()) {
    case Qt::Key_P:
      publish(kInside);
      break;
    case Qt::Key_B:
      publish(kBorder);
      break;
    case Qt::Key_R:
      publish(kRemove);
      break;
    case Qt::Key_C:
      publish(kClear);
      break;
    default:
      if (!event->text().isEmpty()) change_tool(event->text().at(0).toLower().toLatin1());
  }
  return Render;
}

void PointLabelTool::change_tool(char shortcut) {
  rviz::ToolManager* tools = context_->getToolManager();
  for (int i = 0; i < tools->numTools(); ++i) {
    rviz::Tool* tool = tools->getTool(i);
    if (shortcut == '\0' || tool->getShortcutKey() != shortcut) continue;
    tools->setCurrentTool(tool == this ? tools->getDefaultTool() : tool);
    return;
  }
}

void PointLabelTool::highlight() {
  marks_->clear();
  marked_frame_ = context_->getFixedFrame();
  for (const Chosen& chosen : chosen_) add_marks(chosen);
  context_->queueRender();
}

void PointLabelTool::add_marks(const Chosen& chosen) {
  Ogre::Vector3 position;
  Ogre::Quaternion orientation;
  if (!pose_of(*chosen.shown.cloud, position, orientation)) return;
  const CloudPoints points(*chosen.shown.cloud);
  marks_->begin(kMaterial, Ogre::RenderOperation::OT_POINT_LIST);
  for (const std::uint32_t index : chosen.indices) {
    const Eigen::Vector3d point = points.at(index);
    marks_->position(orientation * Ogre::Vector3(point.x(), point.y(), point.z()) + position);
    marks_->colour(1.0f, 0.9f, 0.0f);
  }
  marks_->end();
}

void PointLabelTool::take_highlight_away() {
  marks_->clear();
  context_->queueRender();
}

}  // namespace atom_rviz

PLUGINLIB_EXPORT_CLASS(atom_rviz::PointLabelTool, rviz::Tool)
