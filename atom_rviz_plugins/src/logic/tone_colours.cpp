#include "logic/tone_colours.h"

#include <cmath>

namespace atom_rviz {
namespace {

constexpr double kDark = 0.18;  // luminance of a ground on which bright texts are read better

}  // namespace

double luminance(Colour colour) {
  const auto part = [colour](int shift) {
    const double value = ((colour >> shift) & 0xFF) / 255.0;
    return value <= 0.03928 ? value / 12.92 : std::pow((value + 0.055) / 1.055, 2.4);
  };
  return 0.2126 * part(16) + 0.7152 * part(8) + 0.0722 * part(0);
}

Colour colour_of_tone(Tone tone, Colour ground) {
  const bool on_dark = luminance(ground) < kDark;
  switch (tone) {
    case Tone::kGood:
      return on_dark ? 0x5AD282 : 0x00823C;
    case Tone::kWeak:
      return on_dark ? 0xF0B450 : 0xB06800;
    case Tone::kBad:
      return on_dark ? 0xFF8269 : 0xBE3214;
    default:
      return kNoColour;
  }
}

}  // namespace atom_rviz
