// The panel's page for correcting the labels of a dataset.
#pragma once

#include <QCheckBox>
#include <QTimer>
#include <deque>
#include <functional>

#ifndef Q_MOC_RUN
#include <atom_calibration/CollectionStates.h>
#include <atom_calibration/PlaybackState.h>
#endif

#include "plugins/page.h"
#include "plugins/table_view.h"

namespace atom_rviz {

/// Labels and collections of a dataset, and the services of dataset_playback.
class PlaybackPage : public Page {
 public:
  explicit PlaybackPage(QWidget* parent = nullptr);

  /// Call a function whenever another collection is shown.
  void on_other_collection(const std::function<void()>& call) { on_other_collection_ = call; }

  /// Right and left: next and previous collection; u: undo; s: save; q: save and end; d: what
  /// polygons do. A key that comes before the answer to the last one is kept until then.
  bool press(int key, bool held) override;

 protected:
  void listen() override;
  void show_all() override;
  void show_buttons() override;

 private:
  void lay_out();
  void show_changes();
  void delete_label();
  void set_polygons(bool remove_border);
  void show_collection();
  void press_kept_keys();

  atom_calibration::PlaybackStateConstPtr state_;
  atom_calibration::CollectionStatesConstPtr collections_;
  std::function<void()> on_other_collection_;
  bool changed_ = false;  // something came since it was shown
  std::deque<int> kept_keys_;

  TableView* labels_ = new TableView;
  TableView* table_ = new TableView;
  QPushButton* previous_ = service_button("Previous", "previous_collection", "previous");
  QPushButton* next_ = service_button("Next", "next_collection", "next");
  QPushButton* undo_ = service_button("Undo", "undo", "undo", "Take back the last correction");
  QPushButton* redo_ = service_button("Redo", "redo", "redo");
  QPushButton* save_ =
      service_button("Save", "save_labels", "save",
                     "Write dataset_corrected.json; also done when another collection is shown");
  QPushButton* reset_ =
      service_button("Reset collection", "reset_collection", "reset",
                     "The labels of this collection as the dataset has them; can be undone");
  QPushButton* delete_ = new QPushButton("Delete label");
  QCheckBox* polygons_ = new QCheckBox("Polygons remove border");
  QTimer refresh_timer_;
};

}  // namespace atom_rviz
