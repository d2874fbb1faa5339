// The colours of tones and sensors, as Qt has them.
#pragma once

#include <QBrush>
#include <QColor>
#include <QPalette>

#include "logic/tables.h"
#include "logic/tone_colours.h"

namespace atom_rviz {

/// The colour of a text with a tone.
inline QColor colour_of(Tone tone, const QPalette& palette) {
  const QRgb ground = palette.color(QPalette::Active, QPalette::Base).rgb();
  const Colour colour = colour_of_tone(tone, ground);
  if (colour != kNoColour) return QColor(static_cast<QRgb>(colour));
  if (tone == Tone::kFaint) return palette.color(QPalette::Disabled, QPalette::Text);
  return palette.color(QPalette::Active, QPalette::Text);  // also while it is disabled
}

/// The colour of a sensor.
inline QColor colour_of(Colour colour) {
  return colour == kNoColour ? QColor(128, 128, 128) : QColor(static_cast<QRgb>(colour));
}

}  // namespace atom_rviz
