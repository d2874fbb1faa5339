// Messages of images to what is drawn on the screen.
#pragma once

#include <sensor_msgs/Image.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace atom_rviz {

/// An image of 8 bits for red, green and blue, rows without padding.
struct RgbImage {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::vector<std::uint8_t> rgb;
};

/// Values drawn black and white; those between are grey.
struct GreyRange {
  double black = 0.0;
  double white = 1.0;
};

/// Convert rgb8, bgr8, rgba8, bgra8, mono8, mono16 and OpenCV's 8UC1, 8UC3, 16UC1, 32FC1.
///
/// Depth images (16UC1, 32FC1) and mono16 are drawn grey over `range`; without one, over the middle
/// 98 % of their values. What is no measurement (0 in 16UC1; 0, negative or not finite in 32FC1)
/// is dark red.
///
/// Throws std::invalid_argument, with a sentence for the user: an encoding that is not known, or
/// fewer data than the size demands.
RgbImage to_rgb(const sensor_msgs::Image& image, const std::optional<GreyRange>& range = {});

/// The value of a pixel for the user, "12, 34, 56" or "1.25 m"; empty outside the image, and for
/// images that `to_rgb` refuses.
std::string value_text(const sensor_msgs::Image& image, int column, int row);

}  // namespace atom_rviz
