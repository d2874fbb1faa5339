// A table of the logic in a widget.
#pragma once

#include <QTableWidget>
#include <string>

#include "logic/tables.h"

namespace atom_rviz {

/// Shows a Table; what is selected stays selected when the table changes.
class TableView : public QTableWidget {
 public:
  explicit TableView(QWidget* parent = nullptr);

  void show_table(const Table& table);

  /// Key of the row that is selected; empty when none is.
  std::string selected_key() const;

 private:
  void show_cell(int row, int column, const std::string& key, const Cell& cell);
};

}  // namespace atom_rviz
