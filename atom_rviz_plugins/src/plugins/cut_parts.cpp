#include "plugins/cut_parts.h"

#include <QAbstractButton>
#include <QHeaderView>
#include <QLabel>
#include <QScreen>
#include <QWindow>

#include "plugins/guidance_view.h"
#include "plugins/residual_bars_view.h"
#include "plugins/table_view.h"

namespace atom_rviz {
namespace {

std::string name_of(const QWidget& widget) {
  if (!widget.objectName().isEmpty()) return widget.objectName().toStdString();
  if (const auto* label = qobject_cast<const QLabel*>(&widget)) return label->text().toStdString();
  if (const auto* button = qobject_cast<const QAbstractButton*>(&widget)) {
    return button->text().toStdString();
  }
  return widget.metaObject()->className();
}

QRect on_screen(const QWidget& widget) { return {widget.mapToGlobal(QPoint(0, 0)), widget.size()}; }

std::string size_text(const QSize& size) {
  return std::to_string(size.width()) + " x " + std::to_string(size.height());
}

/// The size below which something of a widget is not to be seen.
QSize needed(const QWidget& widget) {
  const auto* label = qobject_cast<const QLabel*>(&widget);
  if (!label) return widget.minimumSizeHint();
  if (!label->wordWrap()) return label->sizeHint();
  return {0, label->heightForWidth(label->width())};
}

bool is_watched(const QWidget& widget) {
  return qobject_cast<const QLabel*>(&widget) || qobject_cast<const QAbstractButton*>(&widget) ||
         qobject_cast<const ResidualBarsView*>(&widget) ||
         dynamic_cast<const GuidanceView*>(&widget) || dynamic_cast<const TableView*>(&widget);
}

void check_table(const TableView& table, std::vector<std::string>& found) {
  const QHeaderView& header = *table.horizontalHeader();
  int wide = 0;
  for (int i = 0; i < header.count(); ++i) {
    wide += header.sectionSize(i);
    if (header.sectionSize(i) < header.sectionSizeHint(i)) {
      found.push_back(name_of(table) + ": the heading '" +
                      table.horizontalHeaderItem(i)->text().toStdString() + "' is cut");
    }
  }
  if (wide > table.viewport()->width() + 1) {
    found.push_back(name_of(table) + ": its columns need " + std::to_string(wide) + " of " +
                    std::to_string(table.viewport()->width()));
  }
  const int high = table.rowCount() * table.verticalHeader()->defaultSectionSize();
  if (table.shows_all_rows() && high > table.viewport()->height()) {
    found.push_back(name_of(table) + ": " + std::to_string(table.rowCount()) + " rows need " +
                    std::to_string(high) + " of " + std::to_string(table.viewport()->height()));
  }
}

}  // namespace

std::vector<std::string> cut_parts(const QWidget& panel) {
  std::vector<std::string> found;
  const QWidget* window = panel.window();
  const QRect whole = on_screen(*window);
  const QScreen* screen = window->windowHandle() ? window->windowHandle()->screen() : nullptr;
  if (screen && !screen->geometry().contains(window->frameGeometry())) {
    found.push_back("the window reaches beyond the screen: " + size_text(window->frameSize()));
  }
  for (const QWidget* widget : panel.findChildren<QWidget*>()) {
    if (!widget->isVisible() || !is_watched(*widget)) continue;
    if (!whole.contains(on_screen(*widget))) {
      found.push_back(name_of(*widget) + ": is not within the window");
    }
    const QWidget* parent = widget->parentWidget();
    if (parent && !parent->rect().contains(widget->geometry())) {
      found.push_back(name_of(*widget) + ": is cut by what it stands in");
    }
    const QSize least = needed(*widget);
    if (widget->width() < least.width() || widget->height() < least.height()) {
      found.push_back(name_of(*widget) + ": is " + size_text(widget->size()) + " and needs " +
                      size_text(least));
    }
    if (const auto* table = dynamic_cast<const TableView*>(widget)) check_table(*table, found);
  }
  return found;
}

}  // namespace atom_rviz
