// The panel of the calibration in RViz.
#pragma once

#include <rviz/panel.h>

#include <QTabWidget>
#include <array>
#include <memory>

#include "plugins/calibrate_page.h"
#include "plugins/collect_page.h"
#include "plugins/guess_page.h"
#include "plugins/master_watch.h"
#include "plugins/playback_page.h"

namespace atom_rviz {

/// Collecting data, the calibration itself, and correcting labels, a page for each. Never waits for
/// anybody; where a node or the master is missing it says so.
class AtomPanel : public rviz::Panel {
  Q_OBJECT
 public:
  explicit AtomPanel(QWidget* parent = nullptr);

  void onInitialize() override;
  void load(const rviz::Config& config) override;
  void save(rviz::Config config) const override;

  /// Take ATOM's keys where the view, a picture or the panel has the focus; Ctrl with 1, 2, ...:
  /// the page.
  bool eventFilter(QObject* watched, QEvent* event) override;

 protected:
  void showEvent(QShowEvent* event) override;

 private:
  bool takes_keys(QObject* watched) const;

  /// The page that a key is for: the one that is shown, or, where its node does not run and the key
  /// was typed outside the panel, that of the only node that runs.
  Page* page_for_keys(QObject* watched) const;
  std::array<Page*, 4> all_pages() const { return {collect_, calibrate_, playback_, guess_}; }
  void forget_marks();
  void write_geometry();

  QTabWidget* pages_ = new QTabWidget;
  CollectPage* collect_ = new CollectPage;
  CalibratePage* calibrate_ = new CalibratePage;
  PlaybackPage* playback_ = new PlaybackPage;
  GuessPage* guess_ = new GuessPage;
  bool fitted_ = false;
  std::unique_ptr<MasterWatch> master_;  // last: its thread ends before the pages do
};

}  // namespace atom_rviz
