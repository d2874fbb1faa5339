// What the panel shows while the labels of a dataset are corrected.
#pragma once

#include <atom_calibration/CollectionStates.h>
#include <atom_calibration/PlaybackState.h>

#include <string>

#include "logic/tables.h"

namespace atom_rviz {

/// The labels of the collection that is shown: a row for each sensor and pattern, with its figures;
/// m are shown in mm; what is bad is named. The key of a row is its place among the labels, see
/// `label_of_row`.
Table label_table(const atom_calibration::PlaybackState& state);

/// The label of a row of `label_table`; null where there is none.
const atom_calibration::LabelState* label_of_row(const atom_calibration::PlaybackState& state,
                                                 const std::string& key);

/// The detection matrix, sensors in the order of the labels; the collection that is shown stands
/// out.
Table playback_table(const atom_calibration::CollectionStates& collections,
                     const atom_calibration::PlaybackState& state);

/// One line: "Collection 001 (2 of 10) of FILE, not saved".
std::string playback_line(const atom_calibration::PlaybackState& state);

/// Which buttons can do something.
struct PlaybackButtons {
  bool turn = false;  ///< next and previous
  bool undo = false;
  bool redo = false;
  bool reset = false;
  bool save = false;
  bool delete_label = false;
};

/// `selected` is the key of the row that is selected in `label_table`; empty: none.
PlaybackButtons playback_buttons(const atom_calibration::PlaybackState& state,
                                 const std::string& selected);

}  // namespace atom_rviz
