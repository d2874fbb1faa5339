// Images of all encodings to red, green, blue.
#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <stdexcept>

#include "logic/image_conversion.h"

namespace atom_rviz {
namespace {

using Bytes = std::vector<std::uint8_t>;

sensor_msgs::Image image_of(const std::string& encoding, unsigned width, unsigned height,
                            const Bytes& data, unsigned step) {
  sensor_msgs::Image image;
  image.encoding = encoding;
  image.width = width;
  image.height = height;
  image.step = step;
  image.data = data;
  return image;
}

template <typename T>
sensor_msgs::Image numbers(const std::string& encoding, const std::vector<T>& values) {
  Bytes data(values.size() * sizeof(T));
  std::memcpy(data.data(), values.data(), data.size());
  return image_of(encoding, values.size(), 1, data, data.size());
}

TEST(ImageConversion, ColoursComeInTheRightOrder) {
  EXPECT_EQ(to_rgb(image_of("rgb8", 1, 1, {1, 2, 3}, 3)).rgb, (Bytes{1, 2, 3}));
  EXPECT_EQ(to_rgb(image_of("bgr8", 1, 1, {1, 2, 3}, 3)).rgb, (Bytes{3, 2, 1}));
  EXPECT_EQ(to_rgb(image_of("8UC3", 1, 1, {1, 2, 3}, 3)).rgb, (Bytes{3, 2, 1}));
  EXPECT_EQ(to_rgb(image_of("rgba8", 1, 1, {1, 2, 3, 9}, 4)).rgb, (Bytes{1, 2, 3}));
  EXPECT_EQ(to_rgb(image_of("bgra8", 1, 1, {1, 2, 3, 9}, 4)).rgb, (Bytes{3, 2, 1}));
  EXPECT_EQ(to_rgb(image_of("mono8", 2, 1, {7, 8}, 2)).rgb, (Bytes{7, 7, 7, 8, 8, 8}));
}

TEST(ImageConversion, PaddingOfRowsIsLeftOut) {
  const RgbImage image = to_rgb(image_of("mono8", 2, 2, {1, 2, 99, 3, 4, 99}, 3));
  EXPECT_EQ(image.width, 2u);
  EXPECT_EQ(image.height, 2u);
  EXPECT_EQ(image.rgb, (Bytes{1, 1, 1, 2, 2, 2, 3, 3, 3, 4, 4, 4}));
  // The last row of some drivers comes without its padding.
  EXPECT_EQ(to_rgb(image_of("mono8", 2, 2, {1, 2, 99, 3, 4}, 3)).rgb, image.rgb);
}

TEST(ImageConversion, DepthIsGreyOverTheGivenRange) {
  const auto floats = numbers<float>("32FC1", {1.0f, 2.0f, 3.0f, 9.0f});
  const Bytes expected{0, 0, 0, 128, 128, 128, 255, 255, 255, 255, 255, 255};
  EXPECT_EQ(to_rgb(floats, GreyRange{1.0, 3.0}).rgb, expected);
  const auto shorts = numbers<std::uint16_t>("16UC1", {1000, 2000, 3000, 9000});
  EXPECT_EQ(to_rgb(shorts, GreyRange{1000, 3000}).rgb, expected);
}

TEST(ImageConversion, WhatIsNoDepthIsDarkRed) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinity = std::numeric_limits<float>::infinity();
  const Bytes red{64, 0, 0};
  for (const float nothing : {nan, infinity, 0.0f, -1.0f}) {
    const Bytes drawn = to_rgb(numbers<float>("32FC1", {nothing, 1.0f, 2.0f})).rgb;
    EXPECT_EQ(Bytes(drawn.begin(), drawn.begin() + 3), red) << nothing;
    EXPECT_EQ(drawn[3], 0) << "the range comes from what was measured: " << nothing;
    EXPECT_EQ(drawn[6], 255) << nothing;
  }
  EXPECT_EQ(to_rgb(numbers<std::uint16_t>("16UC1", {0})).rgb, red);
  EXPECT_EQ(to_rgb(numbers<std::uint16_t>("mono16", {0, 5})).rgb, (Bytes{0, 0, 0, 255, 255, 255}));
}

TEST(ImageConversion, AutomaticRangeIgnoresSingleFarPixels) {
  std::vector<float> depths(1000, 1.0f);
  std::fill(depths.begin() + 500, depths.end(), 2.0f);
  depths.back() = 1000.0f;
  const Bytes drawn = to_rgb(numbers("32FC1", depths)).rgb;
  EXPECT_EQ(drawn[0], 0);
  EXPECT_EQ(drawn[3 * 600], 255);
}

TEST(ImageConversion, FlatDepthIsMidGrey) {
  EXPECT_EQ(to_rgb(numbers<float>("32FC1", {2.0f})).rgb, (Bytes{128, 128, 128}));
}

TEST(ImageConversion, ByteOrderOfTheMessageCounts) {
  auto image = image_of("16UC1", 2, 1, {0x03, 0xE8, 0x07, 0xD0}, 4);  // 1000, 2000
  image.is_bigendian = 1;
  EXPECT_EQ(to_rgb(image, GreyRange{0, 2000}).rgb, (Bytes{128, 128, 128, 255, 255, 255}));
  EXPECT_EQ(value_text(image, 0, 0), "1.000 m");
}

TEST(ImageConversion, BrokenMessagesAreRefusedWithTheReason) {
  const auto reason = [](const sensor_msgs::Image& image) -> std::string {
    try {
      to_rgb(image);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_NE(reason(image_of("yuv422", 1, 1, {1, 2}, 2)).find("'yuv422'"), std::string::npos);
  EXPECT_NE(reason(image_of("rgb8", 2, 2, {1, 2, 3}, 6)).find("only 3 bytes"), std::string::npos);
  EXPECT_NE(reason(image_of("rgb8", 2, 1, Bytes(6), 3)).find("step 3"), std::string::npos);
  EXPECT_FALSE(reason(image_of("rgb8", 0, 0, {}, 0)).empty());
}

TEST(ImageConversion, ValueUnderTheMouseIsTold) {
  EXPECT_EQ(value_text(image_of("bgr8", 1, 1, {1, 2, 3}, 3), 0, 0), "3, 2, 1");
  EXPECT_EQ(value_text(image_of("mono8", 2, 1, {1, 200}, 2), 1, 0), "200");
  EXPECT_EQ(value_text(numbers<float>("32FC1", {1.25f}), 0, 0), "1.250 m");
  EXPECT_EQ(value_text(numbers<std::uint16_t>("16UC1", {0}), 0, 0), "no depth");
  EXPECT_EQ(value_text(numbers<std::uint16_t>("16UC1", {1250}), 0, 0), "1.250 m");
  EXPECT_EQ(value_text(numbers<std::uint16_t>("mono16", {1250}), 0, 0), "1250");
  EXPECT_EQ(value_text(numbers<float>("32FC1", {1.25f}), 1, 0), "");
  EXPECT_EQ(value_text(numbers<float>("32FC1", {1.25f}), -1, 0), "");
  EXPECT_EQ(value_text(image_of("yuv422", 1, 1, {1, 2}, 2), 0, 0), "");
}

}  // namespace
}  // namespace atom_rviz
