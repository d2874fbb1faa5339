#include "plugins/calibrate_page.h"

#include <QVBoxLayout>

namespace atom_rviz {

CalibratePage::CalibratePage(QWidget* parent) : QWidget(parent) {
  status_->setWordWrap(true);
  status_->setText("No calibration has reported yet on /calibrate/state.");
  auto* layout = new QVBoxLayout(this);
  layout->addWidget(status_);
  layout->addWidget(table_);
}

void CalibratePage::subscribe() {
  subscriber_.shutdown();
  subscriber_ = ros::NodeHandle().subscribe<atom_calibration::CalibrationState>(
      "/calibrate/state", 1, [this](const atom_calibration::CalibrationStateConstPtr& message) {
        status_->setText(QString::fromStdString(calibration_line(*message)));
        table_->show_table(residual_table(*message));
      });
}

}  // namespace atom_rviz
