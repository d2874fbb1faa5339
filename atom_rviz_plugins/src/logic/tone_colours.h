// The colours of tones, which can be read on bright and on dark windows.
#pragma once

#include "logic/tables.h"

namespace atom_rviz {

/// How bright a colour looks, 0 ... 1: the relative luminance of sRGB.
double luminance(Colour colour);

/// The colour of a text that is good, weak or bad, on a ground of some colour. `kNoColour` where
/// the tone has none of its own: plain and faint are the desktop's.
Colour colour_of_tone(Tone tone, Colour ground);

}  // namespace atom_rviz
