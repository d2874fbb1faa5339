#include "plugins/atom_panel.h"

#include <rviz/render_panel.h>

#include <QApplication>
#include <QKeyEvent>
#include <QVBoxLayout>
#include <pluginlib/class_list_macros.hpp>

#include "plugins/image_canvas.h"

namespace atom_rviz {

AtomPanel::AtomPanel(QWidget* parent) : rviz::Panel(parent) {
  pages_->addTab(collect_, "Collect");
  pages_->addTab(calibrate_, "Calibrate");
  pages_->addTab(playback_, "Labels");
  connect(pages_, &QTabWidget::currentChanged, this, &AtomPanel::configChanged);
  auto* layout = new QVBoxLayout(this);
  layout->setContentsMargins(2, 2, 2, 2);
  layout->addWidget(pages_);
  qApp->installEventFilter(this);
}

bool AtomPanel::takes_keys(QObject* watched) const {
  const auto* widget = qobject_cast<QWidget*>(watched);
  if (!widget || !isVisible()) return false;
  return widget == this || isAncestorOf(widget) || qobject_cast<const rviz::RenderPanel*>(widget) ||
         qobject_cast<const ImageCanvas*>(widget);
}

bool AtomPanel::eventFilter(QObject* watched, QEvent* event) {
  if (event->type() == QEvent::KeyPress && takes_keys(watched)) {
    const auto* key = static_cast<QKeyEvent*>(event);
    const bool alone = (key->modifiers() & ~Qt::KeypadModifier) == Qt::NoModifier;
    const auto page = static_cast<std::size_t>(pages_->currentIndex());
    if (alone && all_pages()[page]->press(key->key())) return true;
  }
  return rviz::Panel::eventFilter(watched, event);
}

void AtomPanel::onInitialize() {
  std::vector<std::string> services;
  for (const Page* page : all_pages()) {
    services.insert(services.end(), page->watched_services().begin(),
                    page->watched_services().end());
  }
  master_ = std::make_unique<MasterWatch>(services, [this] {
    for (Page* page : all_pages()) page->subscribe();
  });
  connect(master_.get(), &MasterWatch::changed, this, [this] {
    for (Page* page : all_pages()) page->show_master(master_->status());
  });
}

void AtomPanel::load(const rviz::Config& config) {
  rviz::Panel::load(config);
  int page = 0;
  if (config.mapGetInt("Page", &page)) pages_->setCurrentIndex(page);
}

void AtomPanel::save(rviz::Config config) const {
  rviz::Panel::save(config);
  config.mapSetValue("Page", pages_->currentIndex());
}

}  // namespace atom_rviz

PLUGINLIB_EXPORT_CLASS(atom_rviz::AtomPanel, rviz::Panel)
