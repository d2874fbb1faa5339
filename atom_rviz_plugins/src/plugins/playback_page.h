// The panel's page for correcting the labels of a dataset.
#pragma once

#include <QCheckBox>
#include <QLabel>
#include <QPushButton>
#include <QTimer>
#include <QWidget>

#ifndef Q_MOC_RUN
#include <atom_calibration/CollectionStates.h>
#include <atom_calibration/PlaybackState.h>
#include <ros/ros.h>
#endif

#include "plugins/master_watch.h"
#include "plugins/service_calls.h"
#include "plugins/table_view.h"

namespace atom_rviz {

/// Labels and collections of a dataset, and the services of dataset_playback.
class PlaybackPage : public QWidget {
  Q_OBJECT
 public:
  explicit PlaybackPage(QWidget* parent = nullptr);

  /// Subscribe, anew when the master is another one; always from the same thread, whichever it is.
  void subscribe();

  /// What the master says: whether there is somebody to ask, and what is wrong.
  void show_master(const MasterStatus& status);

  /// The services this page uses that are known beforehand.
  static std::vector<std::string> services();

 private Q_SLOTS:
  void delete_label();
  void set_polygons(bool remove_border);
  void show_collection();
  void refresh();

 private:
  void lay_out();
  void show_buttons();
  void show_message(const std::string& text, bool good);
  void trigger(const std::string& name);
  template <class Service>
  void call(const std::string& name, const Service& service);

  ros::Subscriber state_subscriber_;
  ros::Subscriber collections_subscriber_;
  atom_calibration::PlaybackStateConstPtr state_;
  atom_calibration::CollectionStatesConstPtr collections_;
  bool changed_ = false;  // something came since it was shown
  bool node_runs_ = false;
  int calls_ = 0;

  QLabel* status_ = new QLabel;
  QLabel* message_ = new QLabel;
  TableView* labels_ = new TableView;
  TableView* table_ = new TableView;
  QPushButton* previous_ = new QPushButton("Previous");
  QPushButton* next_ = new QPushButton("Next");
  QPushButton* undo_ = new QPushButton("Undo");
  QPushButton* redo_ = new QPushButton("Redo");
  QPushButton* reset_ = new QPushButton("Reset collection");
  QPushButton* delete_ = new QPushButton("Delete label");
  QPushButton* save_ = new QPushButton("Save");
  QCheckBox* polygons_ = new QCheckBox("Polygons remove border");
  QTimer refresh_timer_;
  ServiceCalls services_;  // last: it ends before what its answers touch
};

}  // namespace atom_rviz
