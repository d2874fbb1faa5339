// Where in its view each sensor has seen boards, drawn.
#pragma once

#include <QWidget>
#include <vector>

#include "logic/guidance.h"

namespace atom_rviz {

/// A line for each sensor: its name, a map of its view with the boards, distances, tilts, words.
class GuidanceView : public QWidget {
 public:
  explicit GuidanceView(QWidget* parent = nullptr);

  void show_rows(const std::vector<GuidanceRow>& rows);

  QSize sizeHint() const override { return minimumSizeHint(); }
  QSize minimumSizeHint() const override;

 protected:
  void paintEvent(QPaintEvent* event) override;
  bool event(QEvent* event) override;

 private:
  void draw_row(QPainter& painter, const GuidanceRow& row, const QRectF& place) const;
  void draw_map(QPainter& painter, const GuidanceRow& row, const QRectF& place) const;
  void draw_gauge(QPainter& painter, const std::vector<double>& values, double largest,
                  const QRectF& place, const QColor& colour, const QString& unit) const;
  QFont small_font() const;
  int line_height() const;
  int words_left() const;

  std::vector<GuidanceRow> rows_;
};

}  // namespace atom_rviz
