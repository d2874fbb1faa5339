#include "plugins/collect_page.h"

#include <atom_calibration/DeleteCollection.h>
#include <atom_calibration/SaveCollection.h>
#include <atom_calibration/SetSeed.h>
#include <std_srvs/SetBool.h>

#include <QHBoxLayout>
#include <QVBoxLayout>

namespace atom_rviz {
namespace {

const char kStateTopic[] = "/collect_data/state";
const char kCollectionsTopic[] = "/collect_data/collections";
const char kSaveService[] = "/collect_data/save_collection";
const char kDeleteService[] = "/collect_data/delete_collection";
const char kAutomaticService[] = "/collect_data/toggle_automatic_data_collector";
constexpr int kRefresh_ms = 250;
constexpr int kArmed_ms = 5000;

}  // namespace

std::vector<std::string> CollectPage::services() {
  return {kSaveService, kDeleteService, kAutomaticService};
}

CollectPage::CollectPage(QWidget* parent) : QWidget(parent) {
  lay_out();
  connect(save_, &QPushButton::clicked, this, &CollectPage::save);
  connect(remove_, &QPushButton::clicked, this, &CollectPage::remove);
  connect(automatic_, &QCheckBox::clicked, this, &CollectPage::set_automatic);
  connect(clear_seed_, &QPushButton::clicked, this, &CollectPage::clear_seed);
  connect(sensors_, &QTableWidget::itemSelectionChanged, this, &CollectPage::refresh);
  connect(table_, &QTableWidget::itemSelectionChanged, this, &CollectPage::disarm);
  connect(&refresh_timer_, &QTimer::timeout, this, &CollectPage::refresh);
  connect(&disarm_timer_, &QTimer::timeout, this, &CollectPage::disarm);
  disarm_timer_.setSingleShot(true);
  refresh_timer_.start(kRefresh_ms);
  status_->setText("Asking the ROS master...");
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
  for (QLabel* label : {status_, message_}) {
    label->setWordWrap(true);
    label->setTextInteractionFlags(Qt::TextSelectableByMouse);
  }
  save_->setToolTip("Take what the sensors see now");
  remove_->setToolTip("Remove the selected collection and its files; asks once more");
  clear_seed_->setToolTip("The selected sensor looks for the board by itself again");
  automatic_->setToolTip("Take a collection wherever the board stands still");
  auto* buttons = new QHBoxLayout;
  for (QWidget* button : {static_cast<QWidget*>(save_), static_cast<QWidget*>(automatic_),
                          static_cast<QWidget*>(remove_), static_cast<QWidget*>(clear_seed_)}) {
    buttons->addWidget(button);
  }
  auto* layout = new QVBoxLayout(this);
  layout->addWidget(status_);
  layout->addWidget(sensors_, 2);
  layout->addLayout(buttons);
  layout->addWidget(table_, 3);
  layout->addWidget(message_);
}

void CollectPage::subscribe() {
  // Callbacks of the global queue are run in the window's thread.
  ros::NodeHandle node;
  state_subscriber_.shutdown();
  collections_subscriber_.shutdown();
  state_subscriber_ = node.subscribe<atom_calibration::CollectorState>(
      kStateTopic, 1,
      [this](const atom_calibration::CollectorStateConstPtr& message) { state_ = message; });
  collections_subscriber_ = node.subscribe<atom_calibration::CollectionStates>(
      kCollectionsTopic, 1, [this](const atom_calibration::CollectionStatesConstPtr& message) {
        collections_ = message;
        collections_changed_ = true;
      });
}

void CollectPage::show_master(const MasterStatus& status) {
  const auto offers = [&status](const char* service) {
    const auto found = status.offered.find(service);
    return found != status.offered.end() && found->second;
  };
  collector_runs_ = status.reachable && offers(kSaveService);
  if (!status.reachable) {
    status_->setText(QString("There is no ROS master at %1. Waiting for it...")
                         .arg(QString::fromStdString(ros::master::getURI())));
  } else if (!collector_runs_) {
    status_->setText(
        "The collector is not running. Start it with\n"
        "roslaunch atom_calibration collect_data.launch config:=... output_folder:=...");
  }
  refresh();
}

void CollectPage::refresh() {
  if (state_) {
    sensors_->blockSignals(true);
    sensors_->show_table(sensor_table(*state_, ros::Time::now().toSec()));
    sensors_->blockSignals(false);
    if (collector_runs_) status_->setText(QString::fromStdString(collector_line(*state_)));
    if (calls_ == 0 && state_->message != last_message_) {
      last_message_ = state_->message;
      show_message(last_message_, true);
    }
  } else if (collector_runs_) {
    status_->setText("The collector is running, but has not said yet how it stands.");
  }
  if (collections_ && collections_changed_) {
    collections_changed_ = false;
    table_->show_table(
        collection_table(*collections_, state_ ? *state_ : atom_calibration::CollectorState()));
    table_->scrollToBottom();
  }
  show_buttons();
}

void CollectPage::show_buttons() {
  const bool free = collector_runs_ && calls_ == 0;
  sensors_->setEnabled(collector_runs_);
  table_->setEnabled(collector_runs_);
  save_->setEnabled(free);
  automatic_->setEnabled(free);
  remove_->setEnabled(free && !table_->selected_key().empty());
  clear_seed_->setEnabled(free && state_ && takes_seed(*state_, sensors_->selected_key()));
  if (free) automatic_->setChecked(state_ && state_->automatic);
}

void CollectPage::show_message(const std::string& text, bool good) {
  message_->setText(QString::fromStdString(text));
  message_->setStyleSheet(good ? "" : "color: #be3214");
}

template <class Service>
void CollectPage::call(const std::string& name, const Service& service, const std::string& done) {
  ++calls_;
  show_message("Waiting for " + name + "...", true);
  services_.call(name, service, [this, name, done](bool success, const std::string& message) {
    --calls_;
    show_message(!message.empty() ? message : success ? done : name + " refused.", success);
    show_buttons();
  });
  show_buttons();
}

void CollectPage::save() { call(kSaveService, atom_calibration::SaveCollection(), "Saved."); }

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
  call(kDeleteService, service, "Deleted " + selected + ".");
}

void CollectPage::disarm() {
  to_remove_.clear();
  remove_->setText("Delete collection");
  show_buttons();
}

void CollectPage::set_automatic(bool on) {
  std_srvs::SetBool service;
  service.request.data = on;
  call(kAutomaticService, service, on ? "Automatic." : "By hand.");
}

void CollectPage::clear_seed() {
  const std::string sensor = sensors_->selected_key();
  if (sensor.empty()) return;
  call("/" + sensor + "/set_seed", atom_calibration::SetSeed(),
       "Seeds of " + sensor + " are automatic.");
}

}  // namespace atom_rviz
