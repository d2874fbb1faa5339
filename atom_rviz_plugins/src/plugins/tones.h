// The colours of tones and sensors, as Qt has them.
#pragma once

#include <QBrush>
#include <QColor>
#include <QPalette>

#include "logic/tables.h"

namespace atom_rviz {

/// The colour of a text with a tone.
inline QColor colour_of(Tone tone, const QPalette& palette) {
  switch (tone) {
    case Tone::kGood:
      return {0, 130, 60};
    case Tone::kWeak:
      return {176, 104, 0};
    case Tone::kBad:
      return {190, 50, 20};
    case Tone::kFaint:
      return palette.color(QPalette::Disabled, QPalette::Text);
    default:
      return palette.color(QPalette::Active, QPalette::Text);  // also while it is disabled
  }
}

/// The colour of a sensor.
inline QColor colour_of(Colour colour) {
  return colour == kNoColour ? QColor(128, 128, 128) : QColor(static_cast<QRgb>(colour));
}

}  // namespace atom_rviz
