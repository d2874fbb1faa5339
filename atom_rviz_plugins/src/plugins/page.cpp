#include "plugins/page.h"

namespace atom_rviz {

Page::Page(const std::string& node, const std::vector<std::string>& watched_services,
           const QString& absent, QWidget* parent)
    : QWidget(parent), node_(node), watched_services_(watched_services), absent_(absent) {
  for (QLabel* label : {status_, message_}) {
    label->setWordWrap(true);
    label->setTextInteractionFlags(Qt::TextSelectableByMouse);
  }
}

void Page::subscribe() {
  for (ros::Subscriber& subscriber : subscribers_) subscriber.shutdown();
  subscribers_.clear();
  listen();
}

void Page::show_master(const MasterStatus& status) {
  if (watched_services_.empty()) return;
  const auto found = status.offered.find(watched_services_.front());
  node_runs_ = status.reachable && found != status.offered.end() && found->second;
  if (!status.reachable) {
    show_status("There is no ROS master at " + ros::master::getURI() + ". Waiting for it...");
  } else if (!node_runs_) {
    status_->setText(absent_);
  }
  show_all();
}

QPushButton* Page::service_button(const QString& text, const QString& object_name,
                                  const std::string& service, const QString& hint) {
  auto* button = new QPushButton(text);
  button->setObjectName(object_name);
  button->setToolTip(hint);
  connect(button, &QPushButton::clicked, this,
          [this, service] { call(service, std_srvs::Trigger()); });
  return button;
}

void Page::show_message(const std::string& text, bool good) {
  message_->setText(QString::fromStdString(text));
  message_->setStyleSheet(good ? "" : "color: #be3214");
}

}  // namespace atom_rviz
