// Whether tones can be read.
#include <gtest/gtest.h>

#include <algorithm>

#include "logic/tone_colours.h"

namespace atom_rviz {
namespace {

constexpr double kLegible = 3.8;  // of 1 ... 21; of large or bold text 3 are asked for
constexpr Colour kWindows[] = {0xFFFFFF, 0xEFF0F1, 0x232629, 0x31363B, 0x46464A, 0x000000};

double contrast(Colour one, Colour other) {
  const double a = luminance(one), b = luminance(other);
  return (std::max(a, b) + 0.05) / (std::min(a, b) + 0.05);
}

TEST(ToneColours, BlackAndWhiteAreTheEndsOfLuminance) {
  EXPECT_DOUBLE_EQ(luminance(0x000000), 0.0);
  EXPECT_NEAR(luminance(0xFFFFFF), 1.0, 1e-12);
  EXPECT_GT(luminance(0x00FF00), luminance(0xFF0000));
}

TEST(ToneColours, AreLegibleOnBrightAndOnDarkWindows) {
  for (const Tone tone : {Tone::kGood, Tone::kWeak, Tone::kBad}) {
    for (const Colour ground : kWindows) {
      EXPECT_GT(contrast(colour_of_tone(tone, ground), ground), kLegible) << ground;
    }
  }
}

TEST(ToneColours, PlainAndFaintAreTheDesktops) {
  for (const Tone tone : {Tone::kPlain, Tone::kFaint}) {
    for (const Colour ground : kWindows) EXPECT_EQ(colour_of_tone(tone, ground), kNoColour);
  }
}

}  // namespace
}  // namespace atom_rviz
