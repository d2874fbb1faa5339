// The panel's page for the first guess.
#pragma once

#ifndef Q_MOC_RUN
#include <atom_calibration/GuessState.h>
#endif

#include "plugins/page.h"
#include "plugins/table_view.h"

namespace atom_rviz {

/// The sensors that are dragged, how well their points fit the board, and what is saved.
class GuessPage : public Page {
 public:
  explicit GuessPage(QWidget* parent = nullptr);

  /// s: save.
  bool press(int key, bool held) override;

 protected:
  void listen() override;
  void show_all() override;
  void show_buttons() override;

 private:
  void lay_out();
  void reset_selected();

  atom_calibration::GuessStateConstPtr state_;
  TableView* table_ = new TableView;
  QLabel* legend_ = new QLabel;
  QPushButton* save_ = service_button("Save", "save_guess", "save", "Write the first guess (s)");
  QPushButton* reset_ = new QPushButton("Reset selected");
  QPushButton* reset_all_ = service_button("Reset all", "reset_guess", "reset_all",
                                           "Put every sensor back to where it was at the start");
};

}  // namespace atom_rviz
