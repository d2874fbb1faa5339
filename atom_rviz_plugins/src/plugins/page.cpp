#include "plugins/page.h"

#include <QFontMetrics>
#include <algorithm>

#include "logic/presence.h"
#include "plugins/tones.h"

namespace atom_rviz {
namespace {

constexpr int kMostLines = 3;  // of a message; the others are told when the mouse rests on it

/// A text as far as it fits into some lines of a width.
QString shortened(const QString& text, const QFontMetrics& metrics, int width) {
  const auto fits = [&](const QString& part) {
    const QRect room(0, 0, width, 10000);
    return metrics.boundingRect(room, Qt::TextWordWrap, part).height() <=
           kMostLines * metrics.lineSpacing();
  };
  if (fits(text)) return text;
  int known = 0;
  int too_long = text.size();
  while (too_long - known > 1) {
    const int middle = (known + too_long) / 2;
    (fits(text.left(middle) + "...") ? known : too_long) = middle;
  }
  return text.left(known) + "...";
}

}  // namespace

Page::Page(const std::string& node, const std::vector<std::string>& watched_services,
           const QString& absent, QWidget* parent)
    : QWidget(parent), node_(node), watched_services_(watched_services), absent_(absent) {
  if (!watched_services_.empty()) watched_services_.push_back(first_service(node));
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
  const Presence presence = presence_of(node_, watched_services_.front(), status.offered);
  node_runs_ = status.reachable && presence == Presence::kRunning;
  if (!status.reachable) {
    show_status("There is no ROS master at " + ros::master::getURI() + ". Waiting for it...");
  } else if (presence == Presence::kStarting) {
    show_status("The node is starting. What it waits for is told below.");
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
  const QString all = QString::fromStdString(text);
  message_->setToolTip(all);
  message_->setText(shortened(all, message_->fontMetrics(), std::max(width() - 20, 200)));
  message_->setStyleSheet(good ? "" : "color: " + colour_of(Tone::kBad, palette()).name());
}

}  // namespace atom_rviz
