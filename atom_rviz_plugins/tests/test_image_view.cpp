// Pixels under the mouse: fitted with margins, zoomed, moved.
#include <gtest/gtest.h>

#include <random>

#include "logic/image_view.h"

namespace atom_rviz {
namespace {

void expect_near(Point2 a, Point2 b, double tolerance = 1e-9) {
  EXPECT_NEAR(a.x, b.x, tolerance);
  EXPECT_NEAR(a.y, b.y, tolerance);
}

ImageView fitted_view(Size2 widget, Size2 image) {
  ImageView view;
  view.resize(widget);
  view.set_image(image);
  return view;
}

TEST(ImageView, PixelZeroIsTheCentreOfTheTopLeftPixel) {
  const ImageView view = fitted_view({640, 480}, {640, 480});
  expect_near(view.pixel_from_widget({0.5, 0.5}), {0, 0});
  expect_near(view.pixel_from_widget({0, 0}), {-0.5, -0.5});
  expect_near(view.pixel_from_widget({640, 480}), {639.5, 479.5});
}

TEST(ImageView, WideWidgetHasMarginsLeftAndRight) {
  const ImageView view = fitted_view({1000, 240}, {640, 480});
  EXPECT_DOUBLE_EQ(view.scale(), 0.5);
  expect_near(view.corner(), {340, 0});
  expect_near(view.pixel_from_widget({340.25, 0.25}), {0, 0});
  EXPECT_FALSE(view.contains(view.pixel_from_widget({339, 120})));
  EXPECT_TRUE(view.contains(view.pixel_from_widget({341, 120})));
}

TEST(ImageView, TallWidgetHasMarginsAboveAndBelow) {
  const ImageView view = fitted_view({1280, 1160}, {640, 480});
  EXPECT_DOUBLE_EQ(view.scale(), 2.0);
  expect_near(view.corner(), {0, 100});
}

TEST(ImageView, ThereAndBackIsTheSamePlaceInEveryView) {
  std::mt19937 generator(1);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  ImageView view = fitted_view({813, 577}, {1280, 720});
  for (int i = 0; i < 200; ++i) {
    const Point2 mouse{400 + 400 * uniform(generator), 280 + 280 * uniform(generator)};
    view.zoom(mouse, 1.0 + 0.3 * uniform(generator));
    view.move({20 * uniform(generator), 20 * uniform(generator)});
    expect_near(view.widget_from_pixel(view.pixel_from_widget(mouse)), mouse);
  }
}

TEST(ImageView, ZoomKeepsThePixelUnderTheMouse) {
  ImageView view = fitted_view({640, 480}, {640, 480});
  const Point2 mouse{200.5, 150.5};
  const Point2 pixel = view.pixel_from_widget(mouse);
  view.zoom(mouse, 3.0);
  EXPECT_DOUBLE_EQ(view.scale(), 3.0);
  expect_near(view.pixel_from_widget(mouse), pixel);
  // Neighbouring screen pixels are a third of a pixel apart: clicks are finer than pixels.
  EXPECT_NEAR(view.pixel_from_widget({201.5, 150.5}).x - pixel.x, 1.0 / 3.0, 1e-12);
}

TEST(ImageView, ZoomingOutEndsWithTheWholeImage) {
  ImageView view = fitted_view({640, 480}, {1280, 960});
  view.zoom({10, 10}, 4.0);
  EXPECT_FALSE(view.fitted());
  view.zoom({600, 400}, 0.001);
  EXPECT_TRUE(view.fitted());
  EXPECT_DOUBLE_EQ(view.scale(), 0.5);
  expect_near(view.corner(), {0, 0});
}

TEST(ImageView, ZoomingInHasAnEnd) {
  ImageView view = fitted_view({640, 480}, {640, 480});
  view.zoom({320, 240}, 1e9);
  EXPECT_DOUBLE_EQ(view.scale(), ImageView::kLargestScale);
}

TEST(ImageView, TheImageCannotBeMovedOutOfSight) {
  ImageView view = fitted_view({640, 480}, {640, 480});
  view.zoom({320, 240}, 2.0);
  view.move({1e6, -1e6});
  EXPECT_TRUE(view.contains(view.pixel_from_widget({320, 240})));
  view.move({-1e7, 1e7});
  EXPECT_TRUE(view.contains(view.pixel_from_widget({320, 240})));
}

TEST(ImageView, FittedViewFollowsTheWidgetAndZoomedViewKeepsItsMiddle) {
  ImageView view = fitted_view({640, 480}, {640, 480});
  view.resize({320, 480});
  EXPECT_DOUBLE_EQ(view.scale(), 0.5);
  view.zoom({100, 200}, 8.0);
  const Point2 middle = view.pixel_from_widget({160, 240});
  view.resize({500, 400});
  EXPECT_DOUBLE_EQ(view.scale(), 4.0);
  expect_near(view.pixel_from_widget({250, 200}), middle);
}

TEST(ImageView, AnotherSizeOfImageIsFittedAnEqualOneIsNot) {
  ImageView view = fitted_view({640, 480}, {640, 480});
  view.zoom({100, 100}, 2.0);
  view.set_image({640, 480});
  EXPECT_DOUBLE_EQ(view.scale(), 2.0);
  view.set_image({320, 240});
  EXPECT_TRUE(view.fitted());
}

TEST(ImageView, WithoutImageOrWidgetNothingIsHit) {
  ImageView view;
  EXPECT_FALSE(view.contains(view.pixel_from_widget({0, 0})));
  view.resize({100, 100});
  EXPECT_FALSE(view.contains(view.pixel_from_widget({50, 50})));
  view.zoom({50, 50}, 2.0);
  view.resize({0, 0});
  view.set_image({10, 10});
  EXPECT_FALSE(view.contains(view.pixel_from_widget({5, 5})));
}

}  // namespace
}  // namespace atom_rviz
