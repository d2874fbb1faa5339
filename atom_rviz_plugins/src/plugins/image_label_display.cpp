#include "plugins/image_label_display.h"

#include <atom_calibration/BorderStroke.h>
#include <geometry_msgs/PointStamped.h>
#include <geometry_msgs/PolygonStamped.h>
#include <rviz/display_group.h>
#include <rviz/panel_dock_widget.h>
#include <rviz/properties/bool_property.h>
#include <rviz/properties/enum_property.h>
#include <rviz/properties/float_property.h>
#include <rviz/properties/ros_topic_property.h>

#include <QMainWindow>
#include <map>
#include <pluginlib/class_list_macros.hpp>
#include <stdexcept>

#include "plugins/image_pane.h"

namespace atom_rviz {
namespace {

constexpr double kMillimetres = 1000.0;  // in a metre; the unit of 16UC1

const std::map<ImageCanvas::Mode, QString>& mode_names() {
  using Mode = ImageCanvas::Mode;
  static const std::map<Mode, QString> names{
      {Mode::kClick, "Click"}, {Mode::kPolygon, "Polygon"}, {Mode::kBorder, "Border"}};
  return names;
}

}  // namespace

ImageLabelDisplay::ImageLabelDisplay() {
  topic_ = new rviz::RosTopicProperty(
      "Topic", "", "sensor_msgs/Image",
      "Image to show. Clicks go to TOPIC/mouse_click and TOPIC/right_click, polygons to "
      "TOPIC/polygon, points and keys for a board's border to TOPIC/border.",
      this, SLOT(update_topic()));
  values_topic_ = new rviz::RosTopicProperty("Values from", "", "sensor_msgs/Image",
                                             "Image of the same size whose values are told under "
                                             "the mouse, such as the depths of a picture "
                                             "with labels. Empty: those of the picture.",
                                             this, SLOT(update_values()));
  mode_ = new rviz::EnumProperty("Mode", "Click", "What the left button does.", this,
                                 SLOT(update_mode()));
  for (const auto& [mode, name] : mode_names()) mode_->addOption(name, static_cast<int>(mode));
  automatic_ = new rviz::BoolProperty("Automatic range", true,
                                      "Depth images: grey over what each image holds.", this,
                                      SLOT(update_range()));
  nearest_m_ = new rviz::FloatProperty("Black at", 0.5f, "This depth, in m, is black.", this,
                                       SLOT(update_range()));
  farthest_m_ = new rviz::FloatProperty("White at", 5.0f, "This depth, in m, is white.", this,
                                        SLOT(update_range()));
}

ImageLabelDisplay::~ImageLabelDisplay() {
  unsubscribe();
  if (!pane_) return;
  setAssociatedWidget(nullptr);
  delete pane_;
}

void ImageLabelDisplay::onInitialize() {
  pane_ = new ImagePane;
  pane_->canvas()->show_image(QImage(), "No topic is chosen.");
  setAssociatedWidget(pane_);
  dock_to_the_right();
  connect(pane_->canvas(), &ImageCanvas::clicked, this,
          [this](double x_px, double y_px) { publish_click(clicks_, x_px, y_px); });
  connect(pane_->canvas(), &ImageCanvas::right_clicked, this,
          [this](double x_px, double y_px) { publish_click(right_clicks_, x_px, y_px); });
  connect(pane_->canvas(), &ImageCanvas::border_clicked, this,
          [this](double x_px, double y_px) { publish_stroke("", x_px, y_px); });
  connect(pane_->canvas(), &ImageCanvas::border_key, this,
          [this](const QString& key) { publish_stroke(key, 0.0, 0.0); });
  connect(pane_->canvas(), &ImageCanvas::polygon_closed, this, &ImageLabelDisplay::publish_polygon);
  connect(pane_->canvas(), &ImageCanvas::hovered, this, &ImageLabelDisplay::show_value);
  connect(pane_, &ImagePane::mode_chosen, this, [this](int mode) {
    mode_->setString(mode_names().at(static_cast<ImageCanvas::Mode>(mode)));
  });
  update_range();
}

// RViz puts all panes to the left, where the panels are, and initializes displays in the order of
// their addresses. Here they stand to the right, in the order of the list; a layout that was saved
// is restored later.
void ImageLabelDisplay::dock_to_the_right() {
  const auto dock = [](ImageLabelDisplay* display) {
    rviz::PanelDockWidget* pane = display->getAssociatedWidgetPanel();
    auto* window = pane ? qobject_cast<QMainWindow*>(pane->parentWidget()) : nullptr;
    if (window) window->addDockWidget(Qt::RightDockWidgetArea, pane);
  };
  dock(this);
  bool is_after = false;
  const auto* group = qobject_cast<rviz::DisplayGroup*>(getParent());
  for (int i = 0; group && i < group->numDisplays(); ++i) {
    auto* other = qobject_cast<ImageLabelDisplay*>(group->getDisplayAt(i));
    if (other && is_after) dock(other);
    if (other == this) is_after = true;
  }
}

void ImageLabelDisplay::setTopic(const QString& topic, const QString& /*datatype*/) {
  topic_->setString(topic);
}

void ImageLabelDisplay::onEnable() { subscribe(); }

void ImageLabelDisplay::onDisable() {
  unsubscribe();
  reset();
}

void ImageLabelDisplay::update_topic() {
  unsubscribe();
  reset();
  subscribe();
}

void ImageLabelDisplay::update_values() {
  values_subscriber_.shutdown();
  values_.reset();
  deleteStatus("Values");
  const std::string topic = values_topic_->getTopicStd();
  if (!isEnabled() || topic.empty()) return;
  try {
    values_subscriber_ = update_nh_.subscribe<sensor_msgs::Image>(
        topic, 1, [this](const sensor_msgs::ImageConstPtr& message) { values_ = message; });
    setStatus(rviz::StatusProperty::Ok, "Values", "OK");
  } catch (const ros::Exception& error) {
    setStatus(rviz::StatusProperty::Error, "Values", error.what());
  }
}

void ImageLabelDisplay::update_mode() {
  if (pane_) pane_->set_mode(static_cast<ImageCanvas::Mode>(mode_->getOptionInt()));
}

void ImageLabelDisplay::update_range() {
  nearest_m_->setHidden(automatic_->getBool());
  farthest_m_->setHidden(automatic_->getBool());
  const std::lock_guard<std::mutex> guard(lock_);
  range_m_.reset();
  if (!automatic_->getBool()) range_m_ = GreyRange{nearest_m_->getFloat(), farthest_m_->getFloat()};
}

void ImageLabelDisplay::reset() {
  rviz::Display::reset();
  {
    const std::lock_guard<std::mutex> guard(lock_);
    newest_.reset();
  }
  shown_ = Shown();
  received_ = 0;
  const QString topic = topic_->getTopic();
  const QString text = topic.isEmpty() ? "No topic is chosen." : "Nothing came yet on " + topic;
  if (pane_) pane_->canvas()->show_image(QImage(), text);
  if (initialized()) setStatus(rviz::StatusProperty::Warn, "Image", text);
}

void ImageLabelDisplay::subscribe() {
  const std::string topic = topic_->getTopicStd();
  if (!isEnabled() || topic.empty()) return;
  try {
    clicks_ = update_nh_.advertise<geometry_msgs::PointStamped>(topic + "/mouse_click", 5);
    right_clicks_ = update_nh_.advertise<geometry_msgs::PointStamped>(topic + "/right_click", 5);
    polygons_ = update_nh_.advertise<geometry_msgs::PolygonStamped>(topic + "/polygon", 5);
    border_ = update_nh_.advertise<atom_calibration::BorderStroke>(
        topic + "/border", 20, [this](const ros::SingleSubscriberPublisher&) { begin_border(); });
    subscriber_ = threaded_nh_.subscribe(topic, 1, &ImageLabelDisplay::take, this);
    update_values();
    setStatus(rviz::StatusProperty::Ok, "Topic", "OK");
  } catch (const ros::Exception& error) {
    setStatus(rviz::StatusProperty::Error, "Topic", error.what());
  }
}

void ImageLabelDisplay::unsubscribe() {
  subscriber_.shutdown();
  values_subscriber_.shutdown();
  clicks_.shutdown();
  right_clicks_.shutdown();
  polygons_.shutdown();
  border_.shutdown();
}

// Runs in the thread of threaded_nh_.
void ImageLabelDisplay::take(const sensor_msgs::ImageConstPtr& message) {
  Shown shown = converted(message);
  bool is_waited_for;
  {
    const std::lock_guard<std::mutex> guard(lock_);
    is_waited_for = newest_.has_value();
    newest_ = std::move(shown);
  }
  if (is_waited_for) return;
  QMetaObject::invokeMethod(
      this, [this] { show_newest(); }, Qt::QueuedConnection);
}

ImageLabelDisplay::Shown ImageLabelDisplay::converted(const sensor_msgs::ImageConstPtr& message) {
  std::optional<GreyRange> range;
  {
    const std::lock_guard<std::mutex> guard(lock_);
    range = range_m_;
  }
  if (range && message->encoding == "16UC1") {
    range = GreyRange{kMillimetres * range->black, kMillimetres * range->white};
  }
  if (message->encoding == "mono16") range.reset();  // its numbers are no depths
  try {
    const RgbImage drawn = to_rgb(*message, range);
    const QImage image(drawn.rgb.data(), static_cast<int>(drawn.width),
                       static_cast<int>(drawn.height), static_cast<int>(3 * drawn.width),
                       QImage::Format_RGB888);
    return {message, image.convertToFormat(QImage::Format_RGB32), ""};  // a copy; draws faster
  } catch (const std::invalid_argument& error) {
    return {message, QImage(), error.what()};
  }
}

void ImageLabelDisplay::show_newest() {
  {
    const std::lock_guard<std::mutex> guard(lock_);
    if (!newest_) return;
    shown_ = std::move(*newest_);
    newest_.reset();
  }
  ++received_;
  pane_->canvas()->show_image(shown_.image, shown_.problem);
  if (received_ == 1) begin_border();
  if (shown_.problem.isEmpty()) {
    setStatus(rviz::StatusProperty::Ok, "Image", QString("%1 images shown").arg(received_));
  } else {
    setStatus(rviz::StatusProperty::Error, "Image", shown_.problem);
  }
}

void ImageLabelDisplay::show_value(int column, int row) {
  if (column < 0 || !shown_.message) {
    pane_->show_value("");
    return;
  }
  const bool fits = values_ && values_->width == shown_.message->width &&
                    values_->height == shown_.message->height;
  const std::string value = value_text(fits ? *values_ : *shown_.message, column, row);
  pane_->show_value(
      QString("(%1, %2): %3").arg(column).arg(row).arg(QString::fromStdString(value)));
}

void ImageLabelDisplay::publish_click(ros::Publisher& clicks, double x_px, double y_px) {
  if (!shown_.message || !clicks) return;
  geometry_msgs::PointStamped click;
  click.header = shown_.message->header;
  click.point.x = x_px;
  click.point.y = y_px;
  clicks.publish(click);
}

void ImageLabelDisplay::publish_stroke(const QString& key, double x_px, double y_px) {
  if (!shown_.message || !border_) return;
  atom_calibration::BorderStroke stroke;
  stroke.header = shown_.message->header;
  stroke.key = key.toStdString();
  stroke.x = x_px;
  stroke.y = y_px;
  border_.publish(stroke);
}

// The mode may be older than the picture, or than the node that draws.
void ImageLabelDisplay::begin_border() {
  if (pane_ && pane_->canvas()->draws_border()) publish_stroke("h", 0.0, 0.0);
}

void ImageLabelDisplay::publish_polygon(const QVector<QPointF>& corners_px) {
  if (!shown_.message || !polygons_) return;
  geometry_msgs::PolygonStamped polygon;
  polygon.header = shown_.message->header;
  for (const QPointF& corner : corners_px) {
    geometry_msgs::Point32 point;
    point.x = static_cast<float>(corner.x());
    point.y = static_cast<float>(corner.y());
    polygon.polygon.points.push_back(point);
  }
  polygons_.publish(polygon);
}

}  // namespace atom_rviz

PLUGINLIB_EXPORT_CLASS(atom_rviz::ImageLabelDisplay, rviz::Display)
