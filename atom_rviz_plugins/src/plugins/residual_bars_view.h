// The residuals of each sensor in each collection, drawn as bars.
#pragma once

#include <QWidget>

#include "logic/residual_bars.h"

namespace atom_rviz {

/// A row of bars for each sensor; a click on one asks for leaving it out, or taking it in again.
class ResidualBarsView : public QWidget {
  Q_OBJECT
 public:
  explicit ResidualBarsView(QWidget* parent = nullptr);

  /// Show a chart; `shown` is the collection that stands out, if any.
  void show_chart(const BarChart& chart, const std::string& shown);

  QSize sizeHint() const override { return minimumSizeHint(); }
  QSize minimumSizeHint() const override;

 Q_SIGNALS:
  void clicked(const QString& sensor, const QString& collection, bool leave_out);

 protected:
  void paintEvent(QPaintEvent* event) override;
  void mousePressEvent(QMouseEvent* event) override;
  bool event(QEvent* event) override;

 private:
  Box room() const;
  void draw_bar(QPainter& painter, const Bar& bar, const Box& cell) const;

  BarChart chart_;
  std::string shown_;
};

}  // namespace atom_rviz
