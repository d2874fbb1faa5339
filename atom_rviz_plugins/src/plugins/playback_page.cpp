#include "plugins/playback_page.h"

#include <atom_calibration/DeleteLabel.h>
#include <atom_calibration/ShowCollection.h>
#include <std_srvs/SetBool.h>

#include <QHBoxLayout>
#include <QVBoxLayout>
#include <map>

#include "logic/playback_tables.h"

namespace atom_rviz {
namespace {

const std::string kPlaybackNode = "/dataset_playback/";
constexpr int kPlaybackRefresh_ms = 100;
constexpr int kPolygonsKey = Qt::Key_D;
const std::map<int, std::string> kServiceOfKey{{Qt::Key_Right, "next"},
                                               {Qt::Key_Left, "previous"},
                                               {Qt::Key_S, "save"},
                                               {Qt::Key_U, "undo"},
                                               {Qt::Key_Q, "quit"}};

}  // namespace

PlaybackPage::PlaybackPage(QWidget* parent)
    : Page(kPlaybackNode, {kPlaybackNode + "save"},
           "No dataset is shown. Start with\n"
           "roslaunch atom_calibration dataset_playback.launch dataset:=...",
           parent) {
  lay_out();
  connect(delete_, &QPushButton::clicked, this, &PlaybackPage::delete_label);
  connect(polygons_, &QCheckBox::clicked, this, &PlaybackPage::set_polygons);
  connect(labels_, &QTableWidget::itemSelectionChanged, this, &PlaybackPage::show_buttons);
  connect(table_, &QTableWidget::itemActivated, this, &PlaybackPage::show_collection);
  connect(&refresh_timer_, &QTimer::timeout, this, &PlaybackPage::show_changes);
  refresh_timer_.start(kPlaybackRefresh_ms);
  show_status("Asking the ROS master...");
  show_buttons();
}

void PlaybackPage::lay_out() {
  // Names for style sheets, by which tests find them on the screen.
  delete_->setObjectName("delete_label");
  polygons_->setObjectName("polygons_remove_border");
  labels_->setObjectName("labels");
  table_->setObjectName("playback_collections");
  delete_->setToolTip("Forget the label that is selected above; can be undone");
  polygons_->setToolTip(
      "A polygon in a depth image takes the border pixels inside it away; otherwise it is filled "
      "anew");
  table_->setToolTip("Double click: show this collection");
  auto* steps = new QHBoxLayout;
  for (QPushButton* button : {previous_, next_, undo_, redo_, save_}) steps->addWidget(button);
  auto* labels = new QHBoxLayout;
  labels->addWidget(delete_);
  labels->addWidget(reset_);
  labels->addWidget(polygons_);
  labels_->fit_rows();
  auto* layout = new QVBoxLayout(this);
  layout->setContentsMargins(4, 4, 4, 4);
  layout->setSpacing(4);
  layout->addWidget(status_);
  layout->addLayout(steps);
  layout->addWidget(labels_);
  layout->addLayout(labels);
  layout->addWidget(table_, 1);
  layout->addWidget(message_);
}

void PlaybackPage::listen() {
  take<atom_calibration::PlaybackState>(
      "state", [this](const atom_calibration::PlaybackStateConstPtr& message) {
        const bool other = state_ && state_->collection != message->collection;
        state_ = message;
        changed_ = true;
        if (other && on_other_collection_) on_other_collection_();
      });
  take<atom_calibration::CollectionStates>(
      "collections", [this](const atom_calibration::CollectionStatesConstPtr& message) {
        collections_ = message;
        changed_ = true;
      });
}

void PlaybackPage::show_changes() {
  if (changed_) show_all();
}

void PlaybackPage::show_all() {
  changed_ = false;
  if (state_) {
    labels_->blockSignals(true);
    labels_->show_table(label_table(*state_));
    labels_->blockSignals(false);
    if (node_runs()) show_status(playback_line(*state_));
    if (!is_waiting()) show_message(state_->message, !state_->failed);
  }
  if (state_ && collections_) table_->show_table(playback_table(*collections_, *state_));
  show_buttons();
}

void PlaybackPage::show_buttons() {
  PlaybackButtons can;
  if (state_ && node_runs() && !is_waiting())
    can = playback_buttons(*state_, labels_->selected_key());
  labels_->setEnabled(node_runs());
  table_->setEnabled(node_runs());
  previous_->setEnabled(can.turn);
  next_->setEnabled(can.turn);
  undo_->setEnabled(can.undo);
  redo_->setEnabled(can.redo);
  reset_->setEnabled(can.reset);
  save_->setEnabled(can.save);
  delete_->setEnabled(can.delete_label);
  polygons_->setEnabled(state_ && node_runs() && !is_waiting());
  if (!is_waiting()) polygons_->setChecked(state_ && state_->polygon_removes_border);
  if (!kept_keys_.empty()) QTimer::singleShot(0, this, &PlaybackPage::press_kept_keys);
}

bool PlaybackPage::press(int key, bool held) {
  const auto service = kServiceOfKey.find(key);
  if (!node_runs() || (service == kServiceOfKey.end() && key != kPolygonsKey)) return false;
  if (is_waiting()) {
    if (!held) kept_keys_.push_back(key);
  } else if (key == kPolygonsKey) {
    polygons_->click();
  } else {
    call(service->second, std_srvs::Trigger());
  }
  return true;
}

void PlaybackPage::press_kept_keys() {
  while (!is_waiting() && !kept_keys_.empty()) {
    const int key = kept_keys_.front();
    kept_keys_.pop_front();
    press(key, false);
  }
}

void PlaybackPage::delete_label() {
  const atom_calibration::LabelState* label =
      state_ ? label_of_row(*state_, labels_->selected_key()) : nullptr;
  if (!label) return;
  atom_calibration::DeleteLabel service;
  service.request.sensor = label->sensor;
  service.request.pattern_name = label->pattern_name;
  call("delete_label", service);
}

void PlaybackPage::set_polygons(bool remove_border) {
  std_srvs::SetBool service;
  service.request.data = remove_border;
  call("polygon_removes_border", service);
}

void PlaybackPage::show_collection() {
  const std::string selected = table_->selected_key();
  if (selected.empty() || is_waiting()) return;
  atom_calibration::ShowCollection service;
  service.request.collection_name = selected;
  call("show_collection", service);
}

}  // namespace atom_rviz
