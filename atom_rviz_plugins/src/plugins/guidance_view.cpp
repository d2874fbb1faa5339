#include "plugins/guidance_view.h"

#include <QHelpEvent>
#include <QPainter>
#include <QToolTip>
#include <algorithm>
#include <cmath>

#include "plugins/tones.h"

namespace atom_rviz {
namespace {

constexpr int kGap = 6;
constexpr int kMapWidth = 92;
constexpr int kGaugeWidth = 66;
constexpr int kMarkSize = 10;
constexpr double kLargestTilt_deg = 90.0;
constexpr double kSmall = 0.85;  // of the font: two lines of words beside a map

QRectF rect_of(const Box& box) { return {box.left, box.top, box.width(), box.height()}; }

Box box_of(const QRectF& rect) { return {rect.left(), rect.top(), rect.right(), rect.bottom()}; }

}  // namespace

GuidanceView::GuidanceView(QWidget* parent) : QWidget(parent) {
  setObjectName("guidance");
  setMouseTracking(true);
}

void GuidanceView::show_rows(const std::vector<GuidanceRow>& rows) {
  const bool resized = rows.size() != rows_.size();
  rows_ = rows;
  if (resized) updateGeometry();
  update();
}

QFont GuidanceView::small_font() const {
  QFont small = font();
  small.setPointSizeF(kSmall * small.pointSizeF());
  return small;
}

int GuidanceView::line_height() const { return 2 * QFontMetrics(small_font()).height() + 2; }

int GuidanceView::words_left() const {
  int name = 0;
  for (const GuidanceRow& row : rows_) {
    name = std::max(name, fontMetrics().horizontalAdvance(QString::fromStdString(row.sensor)));
  }
  return kMarkSize + name + kMapWidth + 2 * kGaugeWidth + 6 * kGap;
}

QSize GuidanceView::minimumSizeHint() const {
  const int words = QFontMetrics(small_font()).horizontalAdvance("tilted another way");
  return {words_left() + words, static_cast<int>(rows_.size()) * line_height()};
}

void GuidanceView::paintEvent(QPaintEvent* /*event*/) {
  QPainter painter(this);
  painter.setRenderHint(QPainter::Antialiasing);
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    draw_row(painter, rows_[i],
             QRectF(0.0, static_cast<double>(i) * line_height(), width(), line_height()));
  }
}

void GuidanceView::draw_row(QPainter& painter, const GuidanceRow& row, const QRectF& place) const {
  const QColor colour = colour_of(row.colour);
  const double words = words_left();
  const double gauges = words - 2 * kGaugeWidth - 2 * kGap;
  const double map = gauges - kMapWidth - kGap;
  painter.fillRect(
      QRectF(place.left() + 2, place.center().y() - kMarkSize / 2.0, kMarkSize, kMarkSize), colour);
  painter.setPen(palette().color(QPalette::Text));
  painter.drawText(QRectF(kMarkSize + kGap, place.top(), map, place.height()), Qt::AlignVCenter,
                   QString::fromStdString(row.sensor));
  draw_map(painter, row, QRectF(map, place.top() + 2, kMapWidth, place.height() - 4));
  double farthest = 1.0;
  for (const GuidanceRow& other : rows_) {
    for (const double distance : other.distances_m) farthest = std::max(farthest, distance);
  }
  draw_gauge(painter, row.distances_m, std::ceil(farthest),
             QRectF(gauges, place.top() + 2, kGaugeWidth, place.height() - 4), colour, "m");
  draw_gauge(painter, row.tilts_deg, kLargestTilt_deg,
             QRectF(gauges + kGaugeWidth + kGap, place.top() + 2, kGaugeWidth, place.height() - 4),
             colour, "deg");
  const double room = width() - words;
  const QFont small = small_font();
  const QFontMetrics metrics(small);
  const auto letters =
      static_cast<std::size_t>(std::max(2.0 * room / metrics.averageCharWidth() - 6.0, 8.0));
  painter.save();
  painter.setFont(small);
  painter.setPen(row.enough ? colour_of(Tone::kGood, palette())
                            : colour_of(Tone::kWeak, palette()));
  painter.drawText(QRectF(words, place.top(), room, place.height()),
                   Qt::AlignVCenter | Qt::TextWordWrap,
                   QString::fromStdString(short_words(row, letters)));
  painter.restore();
}

void GuidanceView::draw_map(QPainter& painter, const GuidanceRow& row, const QRectF& place) const {
  const Box map = fitted(box_of(place), row.aspect);
  painter.fillRect(rect_of(map), QColor(48, 50, 54));
  QColor fill = colour_of(row.colour);
  const QColor line = fill;
  fill.setAlpha(60);
  painter.setBrush(fill);
  painter.setPen(QPen(line, 1.0));
  for (const Box& board : row.boards) painter.drawRect(rect_of(placed(board, map)));
  painter.setBrush(Qt::NoBrush);
  painter.setPen(QPen(Qt::white, 1.5));
  for (const Box& board : row.now) painter.drawRect(rect_of(placed(board, map)));
}

void GuidanceView::draw_gauge(QPainter& painter, const std::vector<double>& values, double largest,
                              const QRectF& place, const QColor& colour,
                              const QString& unit) const {
  const double line = place.top() + 0.25 * place.height();
  painter.setPen(QPen(palette().color(QPalette::Disabled, QPalette::Text), 1.0));
  painter.drawLine(QPointF(place.left(), line), QPointF(place.right(), line));
  painter.setPen(QPen(colour, 2.0));
  for (const double value : values) {
    const double x = place.left() + std::clamp(value / largest, 0.0, 1.0) * place.width();
    painter.drawLine(QPointF(x, line - 4.0), QPointF(x, line + 4.0));
  }
  painter.save();
  painter.setFont(small_font());
  painter.setPen(palette().color(QPalette::Text));
  const QRectF below(place.left(), line + 4.0, place.width(), place.bottom() - line - 3.0);
  painter.drawText(below, Qt::AlignLeft | Qt::AlignVCenter, "0");
  painter.drawText(below, Qt::AlignRight | Qt::AlignVCenter,
                   QString::number(largest, 'f', 0) + " " + unit);
  painter.restore();
}

bool GuidanceView::event(QEvent* event) {
  if (event->type() == QEvent::ToolTip) {
    const auto* help = static_cast<QHelpEvent*>(event);
    const auto row = static_cast<std::size_t>(std::max(help->y(), 0) / line_height());
    if (row < rows_.size()) {
      QToolTip::showText(help->globalPos(), QString::fromStdString(rows_[row].hint), this);
    } else {
      QToolTip::hideText();
    }
    return true;
  }
  return QWidget::event(event);
}

}  // namespace atom_rviz
