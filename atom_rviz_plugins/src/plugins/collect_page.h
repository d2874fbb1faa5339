// The panel's page for collecting data.
#pragma once

#include <QCheckBox>
#include <QTimer>
#include <set>

#ifndef Q_MOC_RUN
#include <atom_calibration/CollectionStates.h>
#include <atom_calibration/CollectorState.h>
#endif

#include "logic/data_ages.h"
#include "plugins/guidance_view.h"
#include "plugins/page.h"
#include "plugins/table_view.h"
#include "plugins/yielding_area.h"

namespace atom_rviz {

/// Sensors, collections and the services of the collector.
class CollectPage : public Page {
 public:
  explicit CollectPage(QWidget* parent = nullptr);

  /// s: save a collection.
  bool press(int key, bool held) override;

 protected:
  void listen() override;
  void show_all() override;
  void show_buttons() override;

 private:
  void lay_out();
  void save();
  void remove();
  void set_automatic(bool on);
  void clear_seed();
  void disarm();
  void flash_new_collection();
  static constexpr int kLeastGuidance = 90;  // three sensors, in screen pixels

  template <class Service>
  void call_and_say(const std::string& name, const Service& service, const std::string& done);

  atom_calibration::CollectorStateConstPtr state_;
  atom_calibration::CollectionStatesConstPtr collections_;
  DataAges ages_;
  bool collections_changed_ = false;
  std::set<std::string> known_;  // collections that were there before
  bool heard_ = false;           // the collections have been told once
  std::string last_message_;     // of the collector
  std::string to_remove_;        // pressed once: the next press removes it

  TableView* sensors_ = new TableView;
  TableView* table_ = new TableView;
  GuidanceView* guidance_ = new GuidanceView;
  YieldingArea* guidance_area_ = new YieldingArea(guidance_, {QWIDGETSIZE_MAX, kLeastGuidance});
  QLabel* legend_ = new QLabel;
  QPushButton* save_ = new QPushButton("Save collection");
  QPushButton* remove_ = new QPushButton("Delete collection");
  QPushButton* clear_seed_ = new QPushButton("Clear seed");
  QCheckBox* automatic_ = new QCheckBox("Automatic");
  QTimer refresh_timer_;
  QTimer disarm_timer_;
};

}  // namespace atom_rviz
