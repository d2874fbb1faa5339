#include "plugins/table_view.h"

#include <QHeaderView>

namespace atom_rviz {
namespace {

QBrush colour_of(Tone tone, const QPalette& palette) {
  switch (tone) {
    case Tone::kGood:
      return QColor(0, 130, 60);
    case Tone::kBad:
      return QColor(190, 50, 20);
    case Tone::kFaint:
      return palette.brush(QPalette::Disabled, QPalette::Text);
    default:
      return palette.brush(QPalette::Active, QPalette::Text);  // also while it is disabled
  }
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
  verticalHeader()->setDefaultSectionSize(fontMetrics().height() + 6);
  horizontalHeader()->setSectionResizeMode(QHeaderView::ResizeToContents);
  horizontalHeader()->setStretchLastSection(true);
}

void TableView::show_table(const Table& table) {
  const int row = currentRow();
  const std::string selected = selected_key();
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

void TableView::show_cell(int row, int column, const std::string& key, const Cell& cell) {
  QTableWidgetItem* item = this->item(row, column);
  if (!item) {
    item = new QTableWidgetItem;
    setItem(row, column, item);
  }
  item->setText(QString::fromStdString(cell.text));
  item->setToolTip(QString::fromStdString(cell.hint));
  item->setForeground(colour_of(cell.tone, palette()));
  item->setData(Qt::UserRole, QString::fromStdString(key));
}

std::string TableView::selected_key() const {
  const QList<QTableWidgetItem*> items = selectedItems();
  return items.isEmpty() ? "" : items.front()->data(Qt::UserRole).toString().toStdString();
}

}  // namespace atom_rviz
