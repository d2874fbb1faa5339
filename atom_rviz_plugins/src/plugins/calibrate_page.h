// The panel's page for a calibration that runs.
#pragma once

#include <QComboBox>

#ifndef Q_MOC_RUN
#include <atom_calibration/CalibrationState.h>
#endif

#include "plugins/page.h"
#include "plugins/residual_bars_view.h"
#include "plugins/table_view.h"
#include "plugins/yielding_area.h"

namespace atom_rviz {

/// How the solver gets on, the residuals of each sensor, and which collection is shown.
class CalibratePage : public Page {
 public:
  explicit CalibratePage(QWidget* parent = nullptr);

 protected:
  void listen() override;
  void show_all() override;
  void show_buttons() override;
  void show_message(const std::string& text, bool good) override;

 private:
  void lay_out();
  void show_choices();
  void choose(int index);
  void leave_out(const QString& sensor, const QString& collection, bool leave_out);

  static constexpr int kLeastBarsWidth = 300;  // in screen pixels
  static constexpr int kLeastBarsHeight = 90;

  atom_calibration::CalibrationState state_;
  TableView* table_ = new TableView;
  ResidualBarsView* bars_ = new ResidualBarsView;
  YieldingArea* bars_area_ = new YieldingArea(bars_, {kLeastBarsWidth, kLeastBarsHeight});
  QLabel* legend_ = new QLabel;
  QComboBox* shown_ = new QComboBox;
  QPushButton* previous_ = service_button("Previous", "previous_shown", "previous");
  QPushButton* next_ = service_button("Next", "next_shown", "next");
};

}  // namespace atom_rviz
