#include "plugins/guess_page.h"

#include <QHBoxLayout>
#include <QVBoxLayout>
#include <algorithm>

#include "logic/graph_name.h"
#include "logic/guess_tables.h"

namespace atom_rviz {
namespace {

const std::string kGuessNode = "/set_initial_estimate/";

}  // namespace

GuessPage::GuessPage(QWidget* parent)
    : Page(kGuessNode, {kGuessNode + "save"},
           "No first guess is being made. Start with\n"
           "roslaunch YOUR_PACKAGE set_initial_estimate.launch",
           parent) {
  lay_out();
  connect(reset_, &QPushButton::clicked, this, &GuessPage::reset_selected);
  connect(table_, &QTableWidget::itemSelectionChanged, this, &GuessPage::show_buttons);
  show_status("Asking the ROS master...");
  show_buttons();
}

void GuessPage::lay_out() {
  // Names for style sheets, by which tests find them on the screen.
  table_->setObjectName("guesses");
  reset_->setObjectName("reset_selected");
  reset_->setToolTip("Put the selected sensor back to where it was at the start");
  table_->fit_rows();
  legend_->setWordWrap(true);
  legend_->setText(
      "Drag a sensor by its arrows and rings until its points lie on the board, the walls and the "
      "floor, in the view and in the images. A few centimetres and degrees are enough.");
  auto* buttons = new QHBoxLayout;
  for (QPushButton* button : {save_, reset_, reset_all_}) buttons->addWidget(button);
  auto* layout = new QVBoxLayout(this);
  layout->setContentsMargins(4, 4, 4, 4);
  layout->setSpacing(4);
  layout->addWidget(status_);
  layout->addWidget(legend_);
  layout->addWidget(table_);
  layout->addLayout(buttons);
  layout->addWidget(message_);
  layout->addStretch(1);
}

void GuessPage::listen() {
  take<atom_calibration::GuessState>("state",
                                     [this](const atom_calibration::GuessStateConstPtr& message) {
                                       state_ = message;
                                       show_all();
                                     });
}

void GuessPage::show_all() {
  if (state_) {
    table_->blockSignals(true);
    table_->show_table(guess_table(*state_));
    table_->blockSignals(false);
    if (node_runs()) show_status(guess_line(*state_));
    if (!is_waiting()) show_message(state_->message, !state_->failed);
  }
  show_buttons();
}

void GuessPage::show_buttons() {
  const bool free = node_runs() && !is_waiting();
  table_->setEnabled(node_runs());
  save_->setEnabled(free);
  reset_all_->setEnabled(free);
  const std::string selected = table_->selected_key();
  const bool movable = state_ && std::any_of(state_->sensors.begin(), state_->sensors.end(),
                                             [&](const atom_calibration::SensorGuess& guess) {
                                               return guess.sensor == selected && !guess.held;
                                             });
  reset_->setEnabled(free && movable);
}

bool GuessPage::press(int key, bool /*held*/) {
  if (!node_runs() || key != Qt::Key_S) return false;
  save_->click();
  return true;
}

void GuessPage::reset_selected() {
  const std::string selected = table_->selected_key();
  if (!selected.empty()) call(graph_name(selected) + "/reset", std_srvs::Trigger());
}

}  // namespace atom_rviz
