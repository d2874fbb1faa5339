// The display of an image that takes clicks and polygons.
#pragma once

#include <rviz/display.h>

#include <QImage>
#include <QPointF>
#include <QVector>
#include <mutex>
#include <optional>

#ifndef Q_MOC_RUN
#include <ros/ros.h>
#include <sensor_msgs/Image.h>
#endif

#include "logic/image_conversion.h"

namespace rviz {
class BoolProperty;
class EnumProperty;
class FloatProperty;
class RosTopicProperty;
}  // namespace rviz

namespace atom_rviz {

class ImagePane;

/// Shows TOPIC in a pane of its own; clicks go to TOPIC/mouse_click and
/// TOPIC/right_click (geometry_msgs/PointStamped),
/// polygons to TOPIC/polygon (geometry_msgs/PolygonStamped). While a board's border is drawn,
/// clicks and the keys of the annotation tool go to TOPIC/border (atom_calibration/BorderStroke),
/// with the key "h" at the beginning and "q" at the end.
///
/// Places are in px of the image, (0, 0) the centre of the top-left pixel, z = 0, with the header
/// of the image that was on the screen.
class ImageLabelDisplay : public rviz::Display {
  Q_OBJECT
 public:
  ImageLabelDisplay();
  ~ImageLabelDisplay() override;

  void onInitialize() override;
  void reset() override;
  void setTopic(const QString& topic, const QString& datatype) override;

 protected:
  void onEnable() override;
  void onDisable() override;

 private Q_SLOTS:
  void update_topic();
  void update_mode();
  void update_range();
  void update_values();

 private:
  struct Shown {
    sensor_msgs::ImageConstPtr message;
    QImage image;
    QString problem;
  };

  void dock_to_the_right();
  void subscribe();
  void unsubscribe();
  void take(const sensor_msgs::ImageConstPtr& message);
  Shown converted(const sensor_msgs::ImageConstPtr& message);
  void show_newest();
  void show_value(int column, int row);
  void publish_click(ros::Publisher& clicks, double x_px, double y_px);
  void publish_stroke(const QString& key, double x_px, double y_px);
  void begin_border();
  void publish_polygon(const QVector<QPointF>& corners_px);

  rviz::RosTopicProperty* topic_;
  rviz::RosTopicProperty* values_topic_;
  rviz::EnumProperty* mode_;
  rviz::BoolProperty* automatic_;
  rviz::FloatProperty* nearest_m_;
  rviz::FloatProperty* farthest_m_;
  ImagePane* pane_ = nullptr;

  ros::Subscriber subscriber_;
  ros::Subscriber values_subscriber_;
  sensor_msgs::ImageConstPtr values_;  // told under the mouse instead of the picture's own
  ros::Publisher clicks_;
  ros::Publisher right_clicks_;
  ros::Publisher polygons_;
  ros::Publisher border_;
  unsigned received_ = 0;
  Shown shown_;

  std::mutex lock_;  // of what the thread that converts and the window share
  std::optional<Shown> newest_;
  std::optional<GreyRange> range_m_;
};

}  // namespace atom_rviz
