#include "plugins/residual_bars_view.h"

#include <QHelpEvent>
#include <QMouseEvent>
#include <QPainter>
#include <QToolTip>
#include <algorithm>

#include "plugins/tones.h"

namespace atom_rviz {
namespace {

constexpr int kSpace = 6;
constexpr int kSquare = 10;
constexpr int kNarrowest = 8;  // a bar that can be hit
constexpr int kWidest = 26;

}  // namespace

ResidualBarsView::ResidualBarsView(QWidget* parent) : QWidget(parent) {
  setObjectName("bars");
  setMouseTracking(true);
}

void ResidualBarsView::show_chart(const BarChart& chart, const std::string& shown) {
  const bool resized = chart.bars.size() != chart_.bars.size();
  chart_ = chart;
  shown_ = shown;
  if (resized) updateGeometry();
  update();
}

QSize ResidualBarsView::minimumSizeHint() const {
  const int columns = static_cast<int>(chart_.collections.size());
  const int rows = static_cast<int>(chart_.sensors.size());
  return {static_cast<int>(room().left) + kNarrowest * columns,
          rows == 0 ? 0 : (fontMetrics().height() + 2) * (rows + 1)};
}

Box ResidualBarsView::room() const {
  int name = 0;
  for (const std::string& sensor : chart_.sensors) {
    name = std::max(name, fontMetrics().horizontalAdvance(QString::fromStdString(sensor)));
  }
  const double left = kSquare + name + 3 * kSpace;
  const double columns = static_cast<double>(chart_.collections.size());
  const double right = std::min(static_cast<double>(width()), left + columns * kWidest);
  return {left, 0.0, std::max(right, left), height() - fontMetrics().height() - 2.0};
}

void ResidualBarsView::paintEvent(QPaintEvent* /*event*/) {
  if (chart_.empty()) return;
  QPainter painter(this);
  const Box all = room();
  const std::vector<Box> cells = bar_cells(chart_, all);
  const std::size_t columns = chart_.collections.size();
  for (std::size_t i = 0; i < chart_.bars.size(); ++i) {
    draw_bar(painter, chart_.bars[i], cells[i]);
    if (i % columns != 0) continue;
    const std::size_t row = i / columns;
    const double middle = (cells[i].top + cells[i].bottom) / 2.0;
    painter.fillRect(QRectF(2.0, middle - kSquare / 2.0, kSquare, kSquare),
                     colour_of(chart_.colours[row]));
    painter.setPen(palette().color(QPalette::Text));
    painter.drawText(QRectF(kSquare + kSpace, cells[i].top, all.left, cells[i].height()),
                     Qt::AlignVCenter, QString::fromStdString(chart_.sensors[row]));
  }
  int free_from = 0;
  for (std::size_t k = 0; k < columns; ++k) {
    const QString name = QString::fromStdString(chart_.collections[k]);
    const int wide = fontMetrics().horizontalAdvance(name);
    const int left = static_cast<int>((cells[k].left + cells[k].right - wide) / 2.0);
    if (left < free_from) continue;
    free_from = left + wide + kSpace;
    painter.setPen(chart_.collections[k] == shown_ ? palette().color(QPalette::Text)
                                                   : colour_of(Tone::kFaint, palette()));
    painter.drawText(left, height() - fontMetrics().descent(), name);
  }
}

void ResidualBarsView::draw_bar(QPainter& painter, const Bar& bar, const Box& cell) const {
  if (bar.collection == shown_) {
    painter.fillRect(QRectF(cell.left, cell.top, cell.width(), cell.height()),
                     palette().color(QPalette::AlternateBase));
  }
  if (!bar.seen) return;
  const double high = bar.height * (cell.height() - 2.0);
  const QRectF place(cell.left + 1.0, cell.bottom - 1.0 - high, cell.width() - 2.0, high);
  if (bar.left_out) {
    painter.setPen(colour_of(Tone::kFaint, palette()));
    painter.setBrush(QBrush(colour_of(Tone::kFaint, palette()), Qt::BDiagPattern));
    painter.drawRect(place);
    return;
  }
  QColor colour = colour_of(bar.tone, palette());
  if (bar.tone == Tone::kPlain) colour = QColor(110, 120, 130);
  painter.fillRect(place, colour);
}

void ResidualBarsView::mousePressEvent(QMouseEvent* event) {
  const Bar* bar = bar_at(chart_, room(), event->localPos().x(), event->localPos().y());
  if (!bar || event->button() != Qt::LeftButton) return;
  Q_EMIT clicked(QString::fromStdString(bar->sensor), QString::fromStdString(bar->collection),
                 !bar->left_out);
}

bool ResidualBarsView::event(QEvent* event) {
  if (event->type() == QEvent::ToolTip) {
    const auto* help = static_cast<QHelpEvent*>(event);
    const Bar* bar = bar_at(chart_, room(), help->x(), help->y());
    QToolTip::showText(help->globalPos(), bar ? QString::fromStdString(bar->hint) : "", this);
    return true;
  }
  return QWidget::event(event);
}

}  // namespace atom_rviz
