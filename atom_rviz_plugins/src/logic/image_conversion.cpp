#include "logic/image_conversion.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <map>
#include <stdexcept>

namespace atom_rviz {
namespace {

enum class Sample { kByte, kShort, kFloat };

struct Layout {
  Sample sample;
  int channels;
  int red;  // position of the red channel; blue is opposite
  bool depth;
};

const std::map<std::string, Layout>& layouts() {
  static const std::map<std::string, Layout> known{
      {"rgb8", {Sample::kByte, 3, 0, false}},  {"bgr8", {Sample::kByte, 3, 2, false}},
      {"8UC3", {Sample::kByte, 3, 2, false}},  {"rgba8", {Sample::kByte, 4, 0, false}},
      {"bgra8", {Sample::kByte, 4, 2, false}}, {"mono8", {Sample::kByte, 1, 0, false}},
      {"8UC1", {Sample::kByte, 1, 0, false}},  {"mono16", {Sample::kShort, 1, 0, false}},
      {"16UC1", {Sample::kShort, 1, 0, true}}, {"32FC1", {Sample::kFloat, 1, 0, true}}};
  return known;
}

std::size_t bytes_of(Sample sample) {
  return sample == Sample::kByte ? 1 : sample == Sample::kShort ? 2 : 4;
}

Layout checked_layout(const sensor_msgs::Image& image) {
  const auto found = layouts().find(image.encoding);
  if (found == layouts().end()) {
    throw std::invalid_argument("encoding '" + image.encoding +
                                "' cannot be shown; known are rgb8, bgr8, rgba8, bgra8, mono8, "
                                "mono16, 8UC1, 8UC3, 16UC1, 32FC1");
  }
  const std::size_t row = image.width * bytes_of(found->second.sample) * found->second.channels;
  if (image.width == 0 || image.height == 0 || image.step < row ||
      image.data.size() < std::size_t{image.step} * (image.height - 1) + row) {
    throw std::invalid_argument("the image of " + std::to_string(image.width) + " x " +
                                std::to_string(image.height) + " has only " +
                                std::to_string(image.data.size()) + " bytes of data, step " +
                                std::to_string(image.step));
  }
  return found->second;
}

/// A number of two or four bytes in the byte order of the message.
template <typename T>
T number_at(const std::uint8_t* data, bool big_endian) {
  std::uint8_t bytes[sizeof(T)];
  for (std::size_t i = 0; i < sizeof(T); ++i) {
    bytes[i] = data[big_endian ? sizeof(T) - 1 - i : i];  // hosts are little endian
  }
  T number;
  std::memcpy(&number, bytes, sizeof(T));
  return number;
}

double sample_at(const sensor_msgs::Image& image, Sample sample, std::size_t column,
                 std::size_t row) {
  const std::uint8_t* data = image.data.data() + row * image.step + column * bytes_of(sample);
  if (sample == Sample::kShort) return number_at<std::uint16_t>(data, image.is_bigendian != 0);
  return number_at<float>(data, image.is_bigendian != 0);
}

bool is_measured(double value, bool depth) {
  return std::isfinite(value) && (!depth || value > 0.0);
}

GreyRange middle_range(const std::vector<double>& values, bool depth) {
  std::vector<double> measured;
  measured.reserve(values.size());
  std::copy_if(values.begin(), values.end(), std::back_inserter(measured),
               [depth](double value) { return is_measured(value, depth); });
  if (measured.empty()) return {};
  const auto quantile = [&measured](double part) {
    const auto place = measured.begin() + std::lround(part * (measured.size() - 1));
    std::nth_element(measured.begin(), place, measured.end());
    return *place;
  };
  const double black = quantile(0.01);
  return {black, quantile(0.99)};
}

std::uint8_t grey(double value, const GreyRange& range) {
  if (range.white == range.black) return 128;
  const double part = (value - range.black) / (range.white - range.black);
  return static_cast<std::uint8_t>(std::lround(255.0 * std::clamp(part, 0.0, 1.0)));
}

void draw_numbers(const sensor_msgs::Image& image, const Layout& layout,
                  const std::optional<GreyRange>& given, RgbImage& drawn) {
  std::vector<double> values;
  values.reserve(std::size_t{image.width} * image.height);
  for (std::size_t row = 0; row < image.height; ++row) {
    for (std::size_t column = 0; column < image.width; ++column) {
      values.push_back(sample_at(image, layout.sample, column, row));
    }
  }
  const GreyRange range = given ? *given : middle_range(values, layout.depth);
  std::uint8_t* out = drawn.rgb.data();
  for (const double value : values) {
    const bool measured = is_measured(value, layout.depth);
    const std::uint8_t shade = measured ? grey(value, range) : 0;
    *out++ = measured ? shade : 64;
    *out++ = shade;
    *out++ = shade;
  }
}

void draw_bytes(const sensor_msgs::Image& image, const Layout& layout, RgbImage& drawn) {
  const int green = layout.channels == 1 ? 0 : 1;
  const int blue = layout.channels == 1 ? 0 : 2 - layout.red;
  std::uint8_t* out = drawn.rgb.data();
  for (std::size_t row = 0; row < image.height; ++row) {
    const std::uint8_t* in = image.data.data() + row * image.step;
    for (std::size_t column = 0; column < image.width; ++column, in += layout.channels) {
      *out++ = in[layout.red];
      *out++ = in[green];
      *out++ = in[blue];
    }
  }
}

}  // namespace

RgbImage to_rgb(const sensor_msgs::Image& image, const std::optional<GreyRange>& range) {
  const Layout layout = checked_layout(image);
  RgbImage drawn{image.width, image.height, {}};
  drawn.rgb.resize(std::size_t{3} * image.width * image.height);
  if (layout.sample == Sample::kByte) {
    draw_bytes(image, layout, drawn);
  } else {
    draw_numbers(image, layout, range, drawn);
  }
  return drawn;
}

std::string value_text(const sensor_msgs::Image& image, int column, int row) {
  if (column < 0 || row < 0 || column >= static_cast<int>(image.width) ||
      row >= static_cast<int>(image.height)) {
    return "";
  }
  Layout layout;
  try {
    layout = checked_layout(image);
  } catch (const std::invalid_argument&) {
    return "";
  }
  if (layout.sample == Sample::kByte) {
    const std::uint8_t* data =
        image.data.data() + std::size_t{image.step} * row + std::size_t(layout.channels) * column;
    if (layout.channels == 1) return std::to_string(data[0]);
    return std::to_string(data[layout.red]) + ", " + std::to_string(data[1]) + ", " +
           std::to_string(data[2 - layout.red]);
  }
  const double value = sample_at(image, layout.sample, column, row);
  if (!layout.depth) return std::to_string(std::lround(value));
  if (!is_measured(value, true)) return "no depth";
  char text[32];
  std::snprintf(text, sizeof(text), "%.3f m",
                layout.sample == Sample::kShort ? value / 1000.0 : value);
  return text;
}

}  // namespace atom_rviz
