// The panel's page for a calibration that runs.
#pragma once

#include <QComboBox>
#include <QLabel>
#include <QPushButton>
#include <QWidget>

#ifndef Q_MOC_RUN
#include <atom_calibration/CalibrationState.h>
#include <ros/ros.h>
#endif

#include "plugins/service_calls.h"
#include "plugins/table_view.h"

namespace atom_rviz {

/// How the solver gets on, the residuals of each sensor, and which collection is shown.
class CalibratePage : public QWidget {
 public:
  explicit CalibratePage(QWidget* parent = nullptr);

  /// Subscribe, anew when the master is another one; always from the same thread, whichever it is.
  void subscribe();

 private:
  void lay_out();
  void show(const atom_calibration::CalibrationState& state);
  void show_choices(const atom_calibration::CalibrationState& state);
  void choose(int index);
  template <class Service>
  void call(const std::string& name, const Service& service);

  ros::Subscriber subscriber_;
  QLabel* status_ = new QLabel;
  QLabel* message_ = new QLabel;
  TableView* table_ = new TableView;
  QComboBox* shown_ = new QComboBox;
  QPushButton* previous_ = new QPushButton("Previous");
  QPushButton* next_ = new QPushButton("Next");
  ServiceCalls services_;  // last: it ends before what its answers touch
};

}  // namespace atom_rviz
