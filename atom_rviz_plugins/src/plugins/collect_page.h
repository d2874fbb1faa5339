// The panel's page for collecting data.
#pragma once

#include <QCheckBox>
#include <QLabel>
#include <QPushButton>
#include <QTimer>
#include <QWidget>

#ifndef Q_MOC_RUN
#include <atom_calibration/CollectionStates.h>
#include <atom_calibration/CollectorState.h>
#include <ros/ros.h>
#endif

#include "plugins/master_watch.h"
#include "plugins/service_calls.h"
#include "plugins/table_view.h"

namespace atom_rviz {

/// Sensors, collections and the services of the collector.
class CollectPage : public QWidget {
  Q_OBJECT
 public:
  explicit CollectPage(QWidget* parent = nullptr);

  /// Subscribe, anew when the master is another one; always from the same thread, whichever it is.
  void subscribe();

  /// What the master says: which buttons can do something, and what is wrong.
  void show_master(const MasterStatus& status);

  /// The services this page uses that are known beforehand.
  static std::vector<std::string> services();

 private Q_SLOTS:
  void save();
  void remove();
  void set_automatic(bool on);
  void clear_seed();
  void refresh();
  void disarm();

 private:
  void lay_out();
  void show_buttons();
  void show_message(const std::string& text, bool good);
  template <class Service>
  void call(const std::string& name, const Service& service, const std::string& done);

  ros::Subscriber state_subscriber_;
  ros::Subscriber collections_subscriber_;
  atom_calibration::CollectorStateConstPtr state_;
  atom_calibration::CollectionStatesConstPtr collections_;
  bool collections_changed_ = false;
  std::string last_message_;  // of the collector
  bool collector_runs_ = false;
  int calls_ = 0;
  std::string to_remove_;  // pressed once: the next press removes it

  QLabel* status_ = new QLabel;
  QLabel* message_ = new QLabel;
  TableView* sensors_ = new TableView;
  TableView* table_ = new TableView;
  QPushButton* save_ = new QPushButton("Save collection");
  QPushButton* remove_ = new QPushButton("Delete collection");
  QPushButton* clear_seed_ = new QPushButton("Clear seed");
  QCheckBox* automatic_ = new QCheckBox("Automatic");
  QTimer refresh_timer_;
  QTimer disarm_timer_;
  ServiceCalls services_;  // last: it ends before what its answers touch
};

}  // namespace atom_rviz
