#include "plugins/playback_page.h"

#include <atom_calibration/DeleteLabel.h>
#include <atom_calibration/ShowCollection.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>

#include <QHBoxLayout>
#include <QVBoxLayout>

#include "logic/playback_tables.h"

namespace atom_rviz {
namespace {

const std::string kNode = "/dataset_playback/";
constexpr int kRefresh_ms = 100;

}  // namespace

std::vector<std::string> PlaybackPage::services() { return {kNode + "save"}; }

PlaybackPage::PlaybackPage(QWidget* parent) : QWidget(parent) {
  lay_out();
  connect(previous_, &QPushButton::clicked, this, [this] { trigger("previous"); });
  connect(next_, &QPushButton::clicked, this, [this] { trigger("next"); });
  connect(undo_, &QPushButton::clicked, this, [this] { trigger("undo"); });
  connect(redo_, &QPushButton::clicked, this, [this] { trigger("redo"); });
  connect(reset_, &QPushButton::clicked, this, [this] { trigger("reset"); });
  connect(save_, &QPushButton::clicked, this, [this] { trigger("save"); });
  connect(delete_, &QPushButton::clicked, this, &PlaybackPage::delete_label);
  connect(polygons_, &QCheckBox::clicked, this, &PlaybackPage::set_polygons);
  connect(labels_, &QTableWidget::itemSelectionChanged, this, &PlaybackPage::show_buttons);
  connect(table_, &QTableWidget::itemActivated, this, &PlaybackPage::show_collection);
  connect(&refresh_timer_, &QTimer::timeout, this, &PlaybackPage::refresh);
  refresh_timer_.start(kRefresh_ms);
  status_->setText("Asking the ROS master...");
  show_buttons();
}

void PlaybackPage::lay_out() {
  // Names for style sheets, by which tests find them on the screen.
  previous_->setObjectName("previous_collection");
  next_->setObjectName("next_collection");
  undo_->setObjectName("undo");
  redo_->setObjectName("redo");
  reset_->setObjectName("reset_collection");
  delete_->setObjectName("delete_label");
  save_->setObjectName("save_labels");
  polygons_->setObjectName("polygons_remove_border");
  labels_->setObjectName("labels");
  table_->setObjectName("playback_collections");
  for (QLabel* label : {status_, message_}) {
    label->setWordWrap(true);
    label->setTextInteractionFlags(Qt::TextSelectableByMouse);
  }
  undo_->setToolTip("Take back the last correction");
  reset_->setToolTip("The labels of this collection as the dataset has them; can be undone");
  delete_->setToolTip("Forget the label that is selected above; can be undone");
  save_->setToolTip("Write dataset_corrected.json; also done when another collection is shown");
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
  auto* layout = new QVBoxLayout(this);
  layout->addWidget(status_);
  layout->addLayout(steps);
  layout->addWidget(labels_, 3);
  layout->addLayout(labels);
  layout->addWidget(table_, 2);
  layout->addWidget(message_);
}

void PlaybackPage::subscribe() {
  // Callbacks of the global queue are run in the window's thread.
  ros::NodeHandle node;
  state_subscriber_.shutdown();
  collections_subscriber_.shutdown();
  state_subscriber_ = node.subscribe<atom_calibration::PlaybackState>(
      kNode + "state", 1, [this](const atom_calibration::PlaybackStateConstPtr& message) {
        state_ = message;
        changed_ = true;
      });
  collections_subscriber_ = node.subscribe<atom_calibration::CollectionStates>(
      kNode + "collections", 1, [this](const atom_calibration::CollectionStatesConstPtr& message) {
        collections_ = message;
        changed_ = true;
      });
}

void PlaybackPage::show_master(const MasterStatus& status) {
  const auto found = status.offered.find(services().front());
  node_runs_ = status.reachable && found != status.offered.end() && found->second;
  if (!status.reachable) {
    status_->setText(QString("There is no ROS master at %1. Waiting for it...")
                         .arg(QString::fromStdString(ros::master::getURI())));
  } else if (!node_runs_) {
    status_->setText(
        "No dataset is shown. Start with\n"
        "roslaunch atom_calibration dataset_playback.launch dataset:=...");
  }
  changed_ = true;
  refresh();
}

void PlaybackPage::refresh() {
  if (!changed_) return;
  changed_ = false;
  if (state_) {
    labels_->blockSignals(true);
    labels_->show_table(label_table(*state_));
    labels_->blockSignals(false);
    if (node_runs_) status_->setText(QString::fromStdString(playback_line(*state_)));
    if (calls_ == 0) show_message(state_->message, !state_->failed);
  }
  if (state_ && collections_) table_->show_table(playback_table(*collections_, *state_));
  show_buttons();
}

void PlaybackPage::show_buttons() {
  PlaybackButtons can;
  if (state_ && node_runs_ && calls_ == 0) can = playback_buttons(*state_, labels_->selected_key());
  labels_->setEnabled(node_runs_);
  table_->setEnabled(node_runs_);
  previous_->setEnabled(can.turn);
  next_->setEnabled(can.turn);
  undo_->setEnabled(can.undo);
  redo_->setEnabled(can.redo);
  reset_->setEnabled(can.reset);
  save_->setEnabled(can.save);
  delete_->setEnabled(can.delete_label);
  polygons_->setEnabled(state_ && node_runs_ && calls_ == 0);
  if (calls_ == 0) polygons_->setChecked(state_ && state_->polygon_removes_border);
}

void PlaybackPage::show_message(const std::string& text, bool good) {
  message_->setText(QString::fromStdString(text));
  message_->setStyleSheet(good ? "" : "color: #be3214");
}

template <class Service>
void PlaybackPage::call(const std::string& name, const Service& service) {
  ++calls_;
  services_.call(kNode + name, service, [this](bool success, const std::string& message) {
    --calls_;
    show_message(message, success);
    show_buttons();
  });
  show_buttons();
}

void PlaybackPage::trigger(const std::string& name) { call(name, std_srvs::Trigger()); }

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
  if (selected.empty() || calls_ > 0) return;
  atom_calibration::ShowCollection service;
  service.request.collection_name = selected;
  call("show_collection", service);
}

}  // namespace atom_rviz
