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

  /// Be as high as all rows need, up to twelve of them; where the window has less room, of four.
  void fit_rows();

  /// Whether there is room for every row.
  bool shows_all_rows() const { return fits_rows_ && rowCount() <= kMostRows; }

  QSize sizeHint() const override;
  QSize minimumSizeHint() const override;

  /// Key of the row that is selected; empty when none is.
  std::string selected_key() const;

 protected:
  void resizeEvent(QResizeEvent* event) override;

 private:
  static constexpr int kMostRows = 12;
  static constexpr int kFewestRows = 4;
  static constexpr int kWidestLast = 110;  // in screen pixels, that the last column has at least

  void keep_last_heading();
  int height_of(int rows) const;
  int height_of_rows_up_to(int most) const;
  void show_cell(int row, int column, const std::string& key, const Cell& cell);

  bool fits_rows_ = false;
};

}  // namespace atom_rviz
