// The panel's page for a calibration that runs.
#pragma once

#include <QLabel>
#include <QWidget>

#ifndef Q_MOC_RUN
#include <atom_calibration/CalibrationState.h>
#include <ros/ros.h>
#endif

#include "plugins/table_view.h"

namespace atom_rviz {

/// How the solver gets on, and the residuals of each sensor.
class CalibratePage : public QWidget {
 public:
  explicit CalibratePage(QWidget* parent = nullptr);

  /// Subscribe, anew when the master is another one; always from the same thread, whichever it is.
  void subscribe();

 private:
  ros::Subscriber subscriber_;
  QLabel* status_ = new QLabel;
  TableView* table_ = new TableView;
};

}  // namespace atom_rviz
