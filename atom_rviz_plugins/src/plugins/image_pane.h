// The canvas of an image with its buttons and a line of text below.
#pragma once

#include <QLabel>
#include <QToolButton>
#include <QWidget>

#include "plugins/image_canvas.h"

namespace atom_rviz {

/// What RViz docks for an image: canvas, mode buttons, and what is under the mouse.
class ImagePane : public QWidget {
  Q_OBJECT
 public:
  explicit ImagePane(QWidget* parent = nullptr);

  ImageCanvas* canvas() { return canvas_; }

  /// Show a mode without telling anybody.
  void set_mode(ImageCanvas::Mode mode);

  /// What the image holds under the mouse.
  void show_value(const QString& text) { value_->setText(text); }

 Q_SIGNALS:
  /// The user chose a mode.
  void mode_chosen(int mode);

 private:
  QToolButton* button(const QString& text, const QString& hint);

  ImageCanvas* canvas_ = new ImageCanvas;
  QToolButton* click_;
  QToolButton* polygon_;
  QToolButton* border_;
  QLabel* value_ = new QLabel;
  QLabel* message_ = new QLabel;
};

}  // namespace atom_rviz
