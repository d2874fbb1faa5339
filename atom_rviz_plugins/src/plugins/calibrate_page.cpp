#include "plugins/calibrate_page.h"

#include <atom_calibration/ShowCollection.h>
#include <std_srvs/Trigger.h>

#include <QHBoxLayout>
#include <QVBoxLayout>

namespace atom_rviz {
namespace {

const std::string kNode = "/calibrate/";

}  // namespace

CalibratePage::CalibratePage(QWidget* parent) : QWidget(parent) {
  lay_out();
  connect(shown_, QOverload<int>::of(&QComboBox::activated), this, &CalibratePage::choose);
  connect(previous_, &QPushButton::clicked, this,
          [this] { call(kNode + "previous", std_srvs::Trigger()); });
  connect(next_, &QPushButton::clicked, this,
          [this] { call(kNode + "next", std_srvs::Trigger()); });
  show_choices(atom_calibration::CalibrationState());
}

void CalibratePage::lay_out() {
  // Names for style sheets, by which tests find them on the screen.
  table_->setObjectName("residuals");
  shown_->setObjectName("shown_collection");
  previous_->setObjectName("previous_shown");
  next_->setObjectName("next_shown");
  for (QLabel* label : {status_, message_}) {
    label->setWordWrap(true);
    label->setTextInteractionFlags(Qt::TextSelectableByMouse);
  }
  status_->setText(
      "No calibration has reported yet. Start one with\n"
      "roslaunch atom_calibration calibrate.launch dataset:=... output:=...");
  message_->hide();
  shown_->setToolTip("Boards, points and images of this collection are shown");
  auto* buttons = new QHBoxLayout;
  buttons->addWidget(previous_);
  buttons->addWidget(shown_, 1);
  buttons->addWidget(next_);
  auto* layout = new QVBoxLayout(this);
  layout->addWidget(status_);
  layout->addWidget(table_);
  layout->addLayout(buttons);
  layout->addWidget(message_);
}

void CalibratePage::subscribe() {
  // Callbacks of the global queue are run in the window's thread.
  subscriber_.shutdown();
  subscriber_ = ros::NodeHandle().subscribe<atom_calibration::CalibrationState>(
      kNode + "state", 1,
      [this](const atom_calibration::CalibrationStateConstPtr& message) { show(*message); });
}

void CalibratePage::show(const atom_calibration::CalibrationState& state) {
  status_->setText(QString::fromStdString(calibration_line(state)));
  table_->show_table(residual_table(state));
  show_choices(state);
}

void CalibratePage::show_choices(const atom_calibration::CalibrationState& state) {
  const std::vector<Choice> choices = collection_choices(state);
  QStringList texts, shown;
  for (const Choice& choice : choices) texts << QString::fromStdString(choice.text);
  for (int i = 0; i < shown_->count(); ++i) shown << shown_->itemText(i);
  if (texts != shown) {  // not with every iteration, which would close an open list
    shown_->clear();
    for (const Choice& choice : choices) {
      shown_->addItem(QString::fromStdString(choice.text), QString::fromStdString(choice.key));
    }
  }
  shown_->setCurrentIndex(choices.empty() ? -1 : chosen(choices, state.collection));
  for (QWidget* widget : {static_cast<QWidget*>(shown_), static_cast<QWidget*>(previous_),
                          static_cast<QWidget*>(next_)}) {
    widget->setEnabled(!choices.empty());
  }
}

void CalibratePage::choose(int index) {
  atom_calibration::ShowCollection service;
  service.request.collection_name = shown_->itemData(index).toString().toStdString();
  call(kNode + "show_collection", service);
}

template <class Service>
void CalibratePage::call(const std::string& name, const Service& service) {
  services_.call(name, service, [this](bool success, const std::string& text) {
    message_->setVisible(!success);  // what is shown the list says
    message_->setText(QString::fromStdString(text));
  });
}

}  // namespace atom_rviz
