#include "plugins/collect_page.h"

#include <atom_calibration/DeleteCollection.h>
#include <atom_calibration/SaveCollection.h>
#include <atom_calibration/SetSeed.h>
#include <std_srvs/SetBool.h>

#include <QApplication>
#include <QHBoxLayout>
#include <QVBoxLayout>

#include "logic/graph_name.h"
#include "plugins/image_canvas.h"

namespace atom_rviz {
namespace {

const std::string kCollectNode = "/collect_data/";
const char kSaveService[] = "save_collection";
const char kDeleteService[] = "delete_collection";
const char kAutomaticService[] = "toggle_automatic_data_collector";
constexpr int kRefresh_ms = 250;
constexpr int kArmed_ms = 5000;

}  // namespace

CollectPage::CollectPage(QWidget* parent)
    : Page(kCollectNode,
           {kCollectNode + kSaveService, kCollectNode + kDeleteService,
            kCollectNode + kAutomaticService},
           "The collector is not running. Start it with\n"
           "roslaunch atom_calibration collect_data.launch config:=... output_folder:=...",
           parent) {
  lay_out();
  connect(save_, &QPushButton::clicked, this, &CollectPage::save);
  connect(remove_, &QPushButton::clicked, this, &CollectPage::remove);
  connect(automatic_, &QCheckBox::clicked, this, &CollectPage::set_automatic);
  connect(clear_seed_, &QPushButton::clicked, this, &CollectPage::clear_seed);
  connect(sensors_, &QTableWidget::itemSelectionChanged, this, &CollectPage::show_all);
  connect(table_, &QTableWidget::itemSelectionChanged, this, &CollectPage::disarm);
  connect(&refresh_timer_, &QTimer::timeout, this, &CollectPage::show_all);
  connect(&disarm_timer_, &QTimer::timeout, this, &CollectPage::disarm);
  disarm_timer_.setSingleShot(true);
  refresh_timer_.start(kRefresh_ms);
  show_status("Asking the ROS master...");
  show_buttons();
}

void CollectPage::lay_out() {
  // Names for style sheets, by which tests find them on the screen.
  save_->setObjectName("save");
  remove_->setObjectName("delete");
  automatic_->setObjectName("automatic");
  clear_seed_->setObjectName("clear_seed");
  sensors_->setObjectName("sensors");
  table_->setObjectName("collections");
  save_->setToolTip("Take what the sensors see now");
  remove_->setToolTip("Remove the selected collection and its files; asks once more");
  clear_seed_->setToolTip("The selected sensor looks for the board by itself again");
  automatic_->setToolTip("Take a collection wherever the board stands still");
  auto* buttons = new QHBoxLayout;
  for (QWidget* button : {static_cast<QWidget*>(save_), static_cast<QWidget*>(automatic_),
                          static_cast<QWidget*>(remove_), static_cast<QWidget*>(clear_seed_)}) {
    buttons->addWidget(button);
  }
  sensors_->fit_rows();
  legend_->setText("Boards in each view (white: now), distance, tilt, and what is missing:");
  legend_->hide();
  auto* layout = new QVBoxLayout(this);
  layout->setContentsMargins(4, 4, 4, 4);
  layout->setSpacing(3);
  layout->addWidget(status_);
  layout->addWidget(sensors_);
  layout->addLayout(buttons);
  layout->addWidget(legend_);
  layout->addWidget(guidance_area_);
  layout->addWidget(table_, 1);
  layout->addWidget(message_);
}

void CollectPage::listen() {
  take<atom_calibration::CollectorState>(
      "state", [this](const atom_calibration::CollectorStateConstPtr& message) {
        state_ = message;
        ages_.note(*message, ros::WallTime::now().toSec());
      });
  take<atom_calibration::CollectionStates>(
      "collections", [this](const atom_calibration::CollectionStatesConstPtr& message) {
        collections_ = message;
        collections_changed_ = true;
      });
}

void CollectPage::show_all() {
  if (state_) {
    sensors_->blockSignals(true);
    const double clock_s = ros::WallTime::now().toSec();
    sensors_->show_table(sensor_table(*state_, ros::Time::now().toSec(), ages_.at(clock_s)));
    sensors_->blockSignals(false);
    if (node_runs()) show_status(collector_line(*state_));
    if (!is_waiting() && state_->message != last_message_) {
      last_message_ = state_->message;
      show_message(last_message_, true);
    }
  } else if (node_runs()) {
    show_status("The collector is running, but has not reported its state yet.");
  }
  if (collections_ && state_) {
    const std::vector<GuidanceRow> rows = guidance_rows(*collections_, *state_);
    legend_->setVisible(!rows.empty());
    guidance_->show_rows(rows);
  }
  if (collections_ && collections_changed_) {
    collections_changed_ = false;
    flash_new_collection();
    table_->show_table(
        collection_table(*collections_, state_ ? *state_ : atom_calibration::CollectorState()));
    table_->scrollToBottom();
  }
  show_buttons();
}

// What the cameras saw is taken: their pictures say so.
void CollectPage::flash_new_collection() {
  bool taken = false;
  std::set<std::string> now;
  for (const auto& collection : collections_->collections) {
    now.insert(collection.name);
    taken = taken || known_.count(collection.name) == 0;
  }
  known_ = now;
  if (taken && heard_) {
    for (QWidget* widget : QApplication::allWidgets()) {
      if (auto* canvas = qobject_cast<ImageCanvas*>(widget)) canvas->flash();
    }
  }
  heard_ = true;
}

void CollectPage::show_buttons() {
  const bool free = node_runs() && !is_waiting();
  sensors_->setEnabled(node_runs());
  table_->setEnabled(node_runs());
  save_->setEnabled(free);
  automatic_->setEnabled(free);
  remove_->setEnabled(free && !table_->selected_key().empty());
  clear_seed_->setEnabled(free && state_ && takes_seed(*state_, sensors_->selected_key()));
  if (free) automatic_->setChecked(state_ && state_->automatic);
}

template <class Service>
void CollectPage::call_and_say(const std::string& name, const Service& service,
                               const std::string& done) {
  show_message("Waiting for " + name + "...", true);
  call_service(name, service, [this, name, done](bool success, const std::string& message) {
    show_message(!message.empty() ? message : success ? done : name + " refused.", success);
  });
}

bool CollectPage::press(int key, bool /*held*/) {
  if (!node_runs() || key != Qt::Key_S) return false;
  save_->click();
  return true;
}

void CollectPage::save() {
  call_and_say(full_name(kSaveService), atom_calibration::SaveCollection(), "Saved.");
}

void CollectPage::remove() {
  const std::string selected = table_->selected_key();
  if (selected.empty()) return;
  if (to_remove_ != selected) {
    to_remove_ = selected;
    remove_->setText(QString::fromStdString("Really delete " + selected + "?"));
    disarm_timer_.start(kArmed_ms);
    return;
  }
  disarm();
  atom_calibration::DeleteCollection service;
  service.request.collection_name = selected;
  call_and_say(full_name(kDeleteService), service, "Deleted " + selected + ".");
}

void CollectPage::disarm() {
  to_remove_.clear();
  remove_->setText("Delete collection");
  show_buttons();
}

void CollectPage::set_automatic(bool on) {
  std_srvs::SetBool service;
  service.request.data = on;
  call_and_say(full_name(kAutomaticService), service, on ? "Automatic." : "By hand.");
}

void CollectPage::clear_seed() {
  const std::string sensor = sensors_->selected_key();
  if (sensor.empty()) return;
  call_and_say("/" + graph_name(sensor) + "/set_seed", atom_calibration::SetSeed(),
               "Seeds of " + sensor + " are automatic.");
}

}  // namespace atom_rviz
