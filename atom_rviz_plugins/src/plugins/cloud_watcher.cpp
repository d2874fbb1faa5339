#include "plugins/cloud_watcher.h"

#include <rviz/display_context.h>
#include <rviz/display_group.h>

#include <boost/make_shared.hpp>

#include "logic/scan_points.h"

namespace atom_rviz {
namespace {

constexpr int kPeriod_ms = 500;

/// Topic to whether its messages are scans.
using Topics = std::map<std::string, bool>;

void add_topics(rviz::DisplayGroup* group, Topics& topics) {
  for (int i = 0; i < group->numDisplays(); ++i) {
    rviz::Display* display = group->getDisplayAt(i);
    if (!display->isEnabled()) continue;
    if (rviz::DisplayGroup* inner = group->getGroupAt(i)) {
      add_topics(inner, topics);
      continue;
    }
    const bool is_scan = display->getClassId() == "rviz/LaserScan";
    if (!is_scan && display->getClassId() != "rviz/PointCloud2") continue;
    const std::string topic = display->subProp("Topic")->getValue().toString().toStdString();
    if (!topic.empty()) topics[topic] = is_scan;
  }
}

std::size_t size_of(const ShownCloud& shown) {
  return std::size_t{shown.cloud->width} * shown.cloud->height;
}

}  // namespace

CloudWatcher::CloudWatcher(rviz::DisplayContext* context, QObject* parent)
    : QObject(parent), context_(context) {
  node_.setCallbackQueue(context->getThreadedQueue());
  connect(&timer_, &QTimer::timeout, this, [this] { look(); });
  timer_.start(kPeriod_ms);
}

CloudWatcher::~CloudWatcher() {
  std::map<std::string, Source> sources;
  {
    const std::lock_guard<std::mutex> guard(lock_);
    sources.swap(sources_);
  }
  for (auto& source : sources) source.second.subscriber.shutdown();  // waits for callbacks
}

void CloudWatcher::look() {
  Topics topics;
  if (rviz::DisplayGroup* root = context_->getRootDisplayGroup()) add_topics(root, topics);
  std::vector<ros::Subscriber> unused;
  {
    const std::lock_guard<std::mutex> guard(lock_);
    for (auto source = sources_.begin(); source != sources_.end();) {
      if (topics.erase(source->first)) {
        ++source;
        continue;
      }
      unused.push_back(source->second.subscriber);
      source = sources_.erase(source);
    }
  }
  for (ros::Subscriber& subscriber : unused) subscriber.shutdown();
  for (const auto& [topic, is_scan] : topics) listen(topic, is_scan);
}

void CloudWatcher::listen(const std::string& topic, bool is_scan) {
  {
    const std::lock_guard<std::mutex> guard(lock_);
    sources_[topic];
  }
  const auto take_cloud = [this, topic](const sensor_msgs::PointCloud2ConstPtr& cloud) {
    keep(topic, cloud);
  };
  const auto take_scan = [this, topic](const sensor_msgs::LaserScanConstPtr& scan) {
    keep(topic, boost::make_shared<sensor_msgs::PointCloud2>(cloud_of_scan(*scan)));
  };
  ros::Subscriber subscriber;
  try {
    subscriber = is_scan ? node_.subscribe<sensor_msgs::LaserScan>(topic, 1, take_scan)
                         : node_.subscribe<sensor_msgs::PointCloud2>(topic, 1, take_cloud);
  } catch (const ros::Exception&) {  // its display says what is wrong; it is not tried again
  }
  const std::lock_guard<std::mutex> guard(lock_);
  sources_[topic].subscriber = subscriber;
}

void CloudWatcher::keep(const std::string& topic, const sensor_msgs::PointCloud2ConstPtr& cloud) {
  const std::lock_guard<std::mutex> guard(lock_);
  const auto source = sources_.find(topic);
  if (source != sources_.end()) source->second.newest = cloud;
}

std::vector<ShownCloud> CloudWatcher::clouds(const std::string& topic) const {
  const std::lock_guard<std::mutex> guard(lock_);
  std::map<std::string, ShownCloud> by_frame;
  for (const auto& [name, source] : sources_) {
    if (!source.newest || (!topic.empty() && topic != name)) continue;
    const ShownCloud shown{name, source.newest};
    ShownCloud& largest = by_frame[source.newest->header.frame_id];
    if (!largest.cloud || size_of(shown) > size_of(largest)) largest = shown;
  }
  std::vector<ShownCloud> clouds;
  for (const auto& entry : by_frame) clouds.push_back(entry.second);
  return clouds;
}

}  // namespace atom_rviz
