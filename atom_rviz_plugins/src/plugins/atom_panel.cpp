#include "plugins/atom_panel.h"

#include <rviz/render_panel.h>
#include <rviz/tool_manager.h>
#include <rviz/visualization_manager.h>

#include <QApplication>
#include <QKeyEvent>
#include <QSaveFile>
#include <QTimer>
#include <QVBoxLayout>
#include <pluginlib/class_list_macros.hpp>

#include "plugins/cut_parts.h"
#include "plugins/fitted_window.h"
#include "plugins/image_canvas.h"
#include "plugins/point_label_tool.h"

namespace atom_rviz {
namespace {

constexpr int kGeometry_ms = 1000;
constexpr char kGeometryFile[] = "ATOM_PANEL_GEOMETRY";

}  // namespace

AtomPanel::AtomPanel(QWidget* parent) : rviz::Panel(parent) {
  pages_->addTab(collect_, "Collect");
  pages_->addTab(calibrate_, "Calibrate");
  pages_->addTab(playback_, "Labels");
  pages_->addTab(guess_, "First guess");
  connect(pages_, &QTabWidget::currentChanged, this, &AtomPanel::configChanged);
  auto* layout = new QVBoxLayout(this);
  layout->setContentsMargins(2, 2, 2, 2);
  layout->addWidget(pages_);
  qApp->installEventFilter(this);
}

bool AtomPanel::takes_keys(QObject* watched) const {
  const auto* widget = qobject_cast<QWidget*>(watched);
  if (!widget || !isVisible()) return false;
  const auto* canvas = qobject_cast<const ImageCanvas*>(widget);
  if (canvas) return !canvas->draws_border();
  return widget == this || isAncestorOf(widget) || qobject_cast<const rviz::RenderPanel*>(widget);
}

bool AtomPanel::eventFilter(QObject* watched, QEvent* event) {
  if (event->type() == QEvent::KeyPress && takes_keys(watched)) {
    const auto* key = static_cast<QKeyEvent*>(event);
    const bool alone = (key->modifiers() & ~Qt::KeypadModifier) == Qt::NoModifier;
    if (alone && page_for_keys(watched)->press(key->key(), key->isAutoRepeat())) {
      return true;
    }
    const int number = key->key() - Qt::Key_1;
    if (key->modifiers() == Qt::ControlModifier && number >= 0 && number < pages_->count()) {
      pages_->setCurrentIndex(number);
      return true;
    }
  }
  return rviz::Panel::eventFilter(watched, event);
}

// With the mouse in the view or in a picture nobody thinks of the page that the panel shows. Keys
// that are typed into the panel itself, as arrows into a table, are for what is there.
Page* AtomPanel::page_for_keys(QObject* watched) const {
  Page* shown = all_pages()[static_cast<std::size_t>(pages_->currentIndex())];
  const auto* widget = qobject_cast<QWidget*>(watched);
  if (shown->node_runs() || widget == this || isAncestorOf(widget)) return shown;
  Page* running = nullptr;
  for (Page* page : all_pages()) {
    if (page->node_runs() && running) return shown;
    if (page->node_runs()) running = page;
  }
  return running ? running : shown;
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
  playback_->on_other_collection([this] { forget_marks(); });
  if (qEnvironmentVariableIsSet(kGeometryFile)) {
    auto* timer = new QTimer(this);
    connect(timer, &QTimer::timeout, this, &AtomPanel::write_geometry);
    timer->start(kGeometry_ms);
  }
  connect(master_.get(), &MasterWatch::changed, this, [this] {
    for (Page* page : all_pages()) page->show_master(master_->status());
  });
}

void AtomPanel::showEvent(QShowEvent* event) {
  rviz::Panel::showEvent(event);
  if (fitted_) return;
  fitted_ = true;
  if (window() != this) fit_into_screen(window());
}

// What was chosen or drawn belongs to the collection that was shown before.
void AtomPanel::forget_marks() {
  for (QWidget* widget : QApplication::allWidgets()) {
    if (auto* canvas = qobject_cast<ImageCanvas*>(widget)) canvas->forget();
  }
  rviz::ToolManager* tools = vis_manager_->getToolManager();
  for (int i = 0; i < tools->numTools(); ++i) {
    if (auto* tool = dynamic_cast<PointLabelTool*>(tools->getTool(i))) tool->forget();
  }
}

// For tests: what of the panel is cut or hidden, a line for each part; a file without lines is
// good.
void AtomPanel::write_geometry() {
  QSaveFile file(QString::fromLocal8Bit(qgetenv(kGeometryFile)));
  if (!isVisible() || !file.open(QIODevice::WriteOnly)) return;
  for (const std::string& part : cut_parts(*this)) {
    file.write(QByteArray::fromStdString(part + "\n"));
  }
  file.commit();
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
