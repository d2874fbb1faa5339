// The clouds that RViz shows, as messages.
#pragma once

#include <QObject>
#include <QTimer>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#ifndef Q_MOC_RUN
#include <ros/ros.h>
#include <sensor_msgs/LaserScan.h>
#include <sensor_msgs/PointCloud2.h>
#endif

namespace rviz {
class DisplayContext;
class DisplayGroup;
}  // namespace rviz

namespace atom_rviz {

/// A cloud and where it came from.
struct ShownCloud {
  std::string topic;
  sensor_msgs::PointCloud2ConstPtr cloud;
};

/// Listens to the topics of all PointCloud2 and LaserScan displays that are switched on; a scan is
/// a cloud of all its beams.
///
/// RViz gives no access to what a display holds, and its own selection gives positions without an
/// index. A second subscriber within the same program gets the same message and costs no copy.
class CloudWatcher : public QObject {
 public:
  CloudWatcher(rviz::DisplayContext* context, QObject* parent);
  ~CloudWatcher() override;

  /// The newest cloud of each display. Of several displays of the same frame only the one with the
  /// most points: data and what a labeler picked out of them, say, when a choice means the data.
  ///
  /// With a `topic` only that one's.
  std::vector<ShownCloud> clouds(const std::string& topic) const;

 private:
  struct Source {
    ros::Subscriber subscriber;
    sensor_msgs::PointCloud2ConstPtr newest;
  };

  void look();
  void listen(const std::string& topic, bool is_scan);
  void keep(const std::string& topic, const sensor_msgs::PointCloud2ConstPtr& cloud);

  rviz::DisplayContext* context_;
  ros::NodeHandle node_;
  QTimer timer_;
  mutable std::mutex lock_;  // of what is in sources_, which only the window's thread extends
  std::map<std::string, Source> sources_;
};

}  // namespace atom_rviz
