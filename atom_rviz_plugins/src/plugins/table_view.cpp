#include "plugins/table_view.h"

#include <QHeaderView>
#include <QIcon>
#include <QPixmap>
#include <QScrollBar>
#include <algorithm>

#include "plugins/tones.h"

namespace atom_rviz {
namespace {

QIcon square_of(Colour colour) {
  QPixmap picture(10, 10);
  picture.fill(colour_of(colour));
  return QIcon(picture);
}

}  // namespace

TableView::TableView(QWidget* parent) : QTableWidget(parent) {
  setSelectionBehavior(QAbstractItemView::SelectRows);
  setSelectionMode(QAbstractItemView::SingleSelection);
  setEditTriggers(QAbstractItemView::NoEditTriggers);
  setWordWrap(false);
  setAlternatingRowColors(true);
  verticalHeader()->hide();
  verticalHeader()->setSectionResizeMode(QHeaderView::Fixed);
  verticalHeader()->setDefaultSectionSize(fontMetrics().height() + 4);
  horizontalHeader()->setSectionResizeMode(QHeaderView::ResizeToContents);
  horizontalHeader()->setStretchLastSection(true);
  setHorizontalScrollMode(QAbstractItemView::ScrollPerPixel);
}

void TableView::show_table(const Table& table) {
  const int row = currentRow();
  const std::string selected = selected_key();
  const bool resized = rowCount() != static_cast<int>(table.rows.size());
  setRowCount(static_cast<int>(table.rows.size()));
  setColumnCount(static_cast<int>(table.header.size()));
  QStringList header;
  for (const std::string& name : table.header) header << QString::fromStdString(name);
  setHorizontalHeaderLabels(header);
  for (std::size_t i = 0; i < table.rows.size(); ++i) {
    for (std::size_t k = 0; k < table.rows[i].cells.size(); ++k) {
      show_cell(static_cast<int>(i), static_cast<int>(k), table.rows[i].key,
                table.rows[i].cells[k]);
    }
  }
  keep_last_heading();
  if (fits_rows_) {
    const int high = height_of_rows_up_to(kMostRows);
    if (high != maximumHeight()) setMaximumHeight(high);
  }
  if (resized) updateGeometry();
  if (selected.empty() || (row == currentRow() && selected == selected_key())) return;
  clearSelection();
  setCurrentCell(-1, -1);
  for (std::size_t i = 0; i < table.rows.size(); ++i) {
    if (table.rows[i].key == selected) {
      selectRow(static_cast<int>(i));
      break;
    }
  }
}

void TableView::fit_rows() {
  fits_rows_ = true;
  setSizePolicy(QSizePolicy::Expanding, QSizePolicy::Preferred);
  setMaximumHeight(height_of_rows_up_to(kMostRows));
}

// A last section that is stretched is also shrunk: its heading would be cut.
void TableView::keep_last_heading() {
  const int last = columnCount() - 1;
  if (last < 0) return;
  int others = 0;
  for (int i = 0; i < last; ++i) others += horizontalHeader()->sectionSize(i);
  const int needed = std::max(horizontalHeader()->sectionSizeHint(last),
                              std::min(sizeHintForColumn(last), kWidestLast));
  const bool stretch = others + needed <= viewport()->width();
  if (stretch != horizontalHeader()->stretchLastSection()) {
    horizontalHeader()->setStretchLastSection(stretch);
  }
}

void TableView::resizeEvent(QResizeEvent* event) {
  QTableWidget::resizeEvent(event);
  keep_last_heading();
}

QSize TableView::sizeHint() const {
  const QSize least = minimumSizeHint();
  return {QTableWidget::sizeHint().width(),
          fits_rows_ ? height_of_rows_up_to(kMostRows) : least.height()};
}

QSize TableView::minimumSizeHint() const {
  const QSize least = QTableWidget::minimumSizeHint();
  return {least.width(), fits_rows_ ? height_of_rows_up_to(kFewestRows) : least.height()};
}

int TableView::height_of_rows_up_to(int most) const {
  return height_of(std::clamp(rowCount(), 1, most));
}

int TableView::height_of(int rows) const {
  return horizontalHeader()->sizeHint().height() + rows * verticalHeader()->defaultSectionSize() +
         2 * frameWidth() +
         (horizontalScrollBar()->isVisible() ? horizontalScrollBar()->height() : 0);
}

void TableView::show_cell(int row, int column, const std::string& key, const Cell& cell) {
  QTableWidgetItem* item = this->item(row, column);
  if (!item) {
    item = new QTableWidgetItem;
    setItem(row, column, item);
  }
  item->setText(QString::fromStdString(cell.text));
  item->setToolTip(QString::fromStdString(cell.hint));
  item->setForeground(colour_of(cell.tone, palette()));
  if (cell.colour != kNoColour) item->setIcon(square_of(cell.colour));
  item->setData(Qt::UserRole, QString::fromStdString(key));
}

std::string TableView::selected_key() const {
  const QList<QTableWidgetItem*> items = selectedItems();
  return items.isEmpty() ? "" : items.front()->data(Qt::UserRole).toString().toStdString();
}

}  // namespace atom_rviz
