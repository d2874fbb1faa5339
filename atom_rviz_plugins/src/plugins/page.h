// What the pages of the panel have in common.
#pragma once

#include <QLabel>
#include <QPushButton>
#include <QWidget>
#include <functional>
#include <string>
#include <vector>

#ifndef Q_MOC_RUN
#include <ros/ros.h>
#include <std_srvs/Trigger.h>
#endif

#include "plugins/master_watch.h"
#include "plugins/service_calls.h"

namespace atom_rviz {

/// A page of the panel for one node: its state, its topics, buttons for its services, and what they
/// answer.
///
/// Messages and answers come in the window's thread, which also destroys the page: none comes while
/// a page is destroyed.
class Page : public QWidget {
 public:
  /// Subscribe, anew when the master is another one; always from the same thread, whichever it is.
  void subscribe();

  /// What the master says: whether the node runs, and what is wrong.
  void show_master(const MasterStatus& status);

  /// A key of ATOM's, pressed alone in the view, a picture or the panel, that is for this page.
  ///
  /// `held`: it repeats itself. Returns whether it has a meaning here; RViz does not see it then.
  virtual bool press(int /*key*/, bool /*held*/) { return false; }

  /// Whether the node runs.
  bool node_runs() const { return node_runs_; }

  /// Services the master is asked for; the node runs where the first of them is offered, and is
  /// there where the last one is.
  const std::vector<std::string>& watched_services() const { return watched_services_; }

 protected:
  using Answer = std::function<void(bool success, const std::string& message)>;

  /// A page for `node`, a namespace such as "/calibrate/"; `absent` says how to start it.
  Page(const std::string& node, const std::vector<std::string>& watched_services,
       const QString& absent, QWidget* parent);

  /// Listen to the topics that the page shows.
  virtual void listen() = 0;

  /// Show all that is known, also that the node has come or gone.
  virtual void show_all() = 0;

  /// Enable the buttons that can do something now.
  virtual void show_buttons() = 0;

  /// Take the messages of a topic of the node, in the window's thread.
  template <class Message>
  void take(const std::string& topic,
            const boost::function<void(const boost::shared_ptr<const Message>&)>& taken) {
    subscribers_.push_back(ros::NodeHandle().subscribe<Message>(node_ + topic, 1, taken));
  }

  /// Call a service by its full name; the buttons are shown anew before and after it.
  template <class Service>
  void call_service(const std::string& name, const Service& service, const Answer& answer) {
    ++calls_;
    services_.call(name, service, [this, answer](bool success, const std::string& message) {
      --calls_;
      answer(success, message);
      show_buttons();
    });
    show_buttons();
  }

  /// Call a service of the node and show what it answers.
  template <class Service>
  void call(const std::string& name, const Service& service) {
    call_service(node_ + name, service, [this](bool success, const std::string& message) {
      show_message(message, success);
    });
  }

  /// A button for a service of the node that needs no more than its name: undo, redo, save, ...
  ///
  /// By `object_name` style sheets, and tests, find it on the screen.
  QPushButton* service_button(const QString& text, const QString& object_name,
                              const std::string& service, const QString& hint = "");

  void show_status(const std::string& text) { status_->setText(QString::fromStdString(text)); }
  virtual void show_message(const std::string& text, bool good);

  /// Whether a service has not answered yet.
  bool is_waiting() const { return calls_ > 0; }

  /// Full name of a service of the node.
  std::string full_name(const std::string& service) const { return node_ + service; }

  QLabel* status_ = new QLabel;
  QLabel* message_ = new QLabel;

 private:
  const std::string node_;
  std::vector<std::string> watched_services_;
  const QString absent_;
  std::vector<ros::Subscriber> subscribers_;
  bool node_runs_ = false;
  int calls_ = 0;
  ServiceCalls services_;  // last: it ends before what its answers touch here
};

}  // namespace atom_rviz
