#include "plugins/calibrate_page.h"

#include <atom_calibration/LeaveOut.h>
#include <atom_calibration/ShowCollection.h>

#include <QHBoxLayout>
#include <QVBoxLayout>

#include "plugins/tones.h"

namespace atom_rviz {

CalibratePage::CalibratePage(QWidget* parent) : Page("/calibrate/", {}, "", parent) {
  lay_out();
  connect(shown_, QOverload<int>::of(&QComboBox::activated), this, &CalibratePage::choose);
  connect(bars_, &ResidualBarsView::clicked, this, &CalibratePage::leave_out);
  show_choices();
  show_buttons();
}

void CalibratePage::lay_out() {
  // Names for style sheets, by which tests find them on the screen.
  table_->setObjectName("residuals");
  shown_->setObjectName("shown_collection");
  status_->setText(
      "No calibration has reported yet. Start one with\n"
      "roslaunch atom_calibration calibrate.launch dataset:=... output:=...");
  message_->hide();
  shown_->setToolTip("Boards, points and images of this collection are shown");
  auto* buttons = new QHBoxLayout;
  buttons->addWidget(previous_);
  buttons->addWidget(shown_, 1);
  buttons->addWidget(next_);
  table_->fit_rows();
  legend_->setWordWrap(true);
  legend_->setText(
      QString("<font color='%1'>Good</font>, <font color='%2'>weak</font>, <font color='%3'>wrong"
              "</font>; in the view white and thin: before. Bars: residuals by sensor, in its own "
              "scale, and collection; a click leaves one out and solves again.")
          .arg(colour_of(Tone::kGood, palette()).name(), colour_of(Tone::kWeak, palette()).name(),
               colour_of(Tone::kBad, palette()).name()));
  auto* layout = new QVBoxLayout(this);
  layout->setContentsMargins(4, 4, 4, 4);
  layout->setSpacing(4);
  layout->addWidget(status_);
  layout->addLayout(buttons);
  layout->addWidget(table_);
  layout->addWidget(legend_);
  layout->addWidget(bars_area_, 1);
  layout->addWidget(message_);
}

void CalibratePage::listen() {
  take<atom_calibration::CalibrationState>(
      "state", [this](const atom_calibration::CalibrationStateConstPtr& message) {
        state_ = *message;
        show_all();
      });
}

void CalibratePage::show_all() {
  show_status(calibration_line(state_));
  table_->show_table(residual_table(state_));
  bars_->show_chart(bar_chart(state_), state_.collection);
  show_choices();
  show_buttons();
}

void CalibratePage::show_choices() {
  const std::vector<Choice> choices = collection_choices(state_);
  QStringList texts, shown;
  for (const Choice& choice : choices) texts << QString::fromStdString(choice.text);
  for (int i = 0; i < shown_->count(); ++i) shown << shown_->itemText(i);
  if (texts != shown) {  // not with every iteration, which would close an open list
    shown_->clear();
    for (const Choice& choice : choices) {
      shown_->addItem(QString::fromStdString(choice.text), QString::fromStdString(choice.key));
    }
  }
  shown_->setCurrentIndex(choices.empty() ? -1 : chosen(choices, state_.collection));
}

void CalibratePage::show_buttons() {
  for (QWidget* widget : {static_cast<QWidget*>(shown_), static_cast<QWidget*>(previous_),
                          static_cast<QWidget*>(next_)}) {
    widget->setEnabled(shown_->count() > 0);
  }
}

void CalibratePage::choose(int index) {
  atom_calibration::ShowCollection service;
  service.request.collection_name = shown_->itemData(index).toString().toStdString();
  call("show_collection", service);
}

void CalibratePage::leave_out(const QString& sensor, const QString& collection, bool leave_out) {
  if (is_waiting()) return;
  atom_calibration::LeaveOut service;
  service.request.sensor = sensor.toStdString();
  service.request.collection_name = collection.toStdString();
  service.request.leave_out = leave_out;
  call_service(full_name("leave_out"), service, [this](bool success, const std::string& message) {
    message_->setVisible(true);
    Page::show_message(message, success);
  });
}

void CalibratePage::show_message(const std::string& text, bool good) {
  message_->setVisible(!good);  // what is shown the list says
  Page::show_message(text, good);
}

}  // namespace atom_rviz
