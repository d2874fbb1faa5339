// A polygon while it is drawn.
#include <gtest/gtest.h>

#include "logic/polygon_drawing.h"

namespace atom_rviz {
namespace {

using Outcome = PolygonDrawing::Outcome;
constexpr double kRadius_px = 5.0;

PolygonDrawing with_corners(std::initializer_list<Point2> corners) {
  PolygonDrawing drawing;
  for (const Point2& corner : corners) EXPECT_EQ(drawing.add(corner, kRadius_px), Outcome::kAdded);
  return drawing;
}

TEST(PolygonDrawing, ClosedPolygonHasTheCornersInOrder) {
  PolygonDrawing drawing = with_corners({{10, 10}, {50.25, 12}, {40, 60}});
  EXPECT_EQ(drawing.close(), Outcome::kClosed);
  ASSERT_EQ(drawing.closed().size(), 3u);
  EXPECT_DOUBLE_EQ(drawing.closed()[1].x, 50.25);
  EXPECT_TRUE(drawing.corners().empty());
}

TEST(PolygonDrawing, ClickOnTheFirstCornerClosesWithoutAddingIt) {
  PolygonDrawing drawing = with_corners({{10, 10}, {50, 10}, {50, 50}});
  EXPECT_EQ(drawing.add({13, 12}, kRadius_px), Outcome::kClosed);
  EXPECT_EQ(drawing.closed().size(), 3u);
}

TEST(PolygonDrawing, SecondCornerNearTheFirstDoesNotClose) {
  PolygonDrawing drawing = with_corners({{10, 10}});
  EXPECT_EQ(drawing.add({12, 10}, kRadius_px), Outcome::kAdded);
  EXPECT_EQ(drawing.corners().size(), 2u);
}

TEST(PolygonDrawing, FewerThanThreeCornersOrALineDoNotClose) {
  PolygonDrawing drawing = with_corners({{10, 10}, {20, 20}});
  EXPECT_EQ(drawing.close(), Outcome::kTooSmall);
  EXPECT_EQ(drawing.add({30, 30}, kRadius_px), Outcome::kAdded);
  EXPECT_EQ(drawing.close(), Outcome::kTooSmall);
  EXPECT_EQ(drawing.corners().size(), 3u) << "what was drawn must not be lost";
}

TEST(PolygonDrawing, DoubleClickIsOneCorner) {
  PolygonDrawing drawing = with_corners({{10, 10}});
  EXPECT_EQ(drawing.add({10, 10}, kRadius_px), Outcome::kNothing);
  EXPECT_EQ(drawing.corners().size(), 1u);
}

TEST(PolygonDrawing, TakeBackRemovesTheLastCorner) {
  PolygonDrawing drawing = with_corners({{10, 10}, {20, 20}});
  EXPECT_EQ(drawing.take_back(), Outcome::kTakenBack);
  EXPECT_DOUBLE_EQ(drawing.corners().back().x, 10);
  EXPECT_EQ(drawing.take_back(), Outcome::kCancelled);
  EXPECT_EQ(drawing.take_back(), Outcome::kNothing);
}

TEST(PolygonDrawing, CancelForgetsWhatIsDrawnButNotWhatIsClosed) {
  PolygonDrawing drawing = with_corners({{0, 0}, {10, 0}, {10, 10}});
  EXPECT_EQ(drawing.close(), Outcome::kClosed);
  EXPECT_EQ(drawing.cancel(), Outcome::kNothing);
  EXPECT_EQ(drawing.add({1, 1}, kRadius_px), Outcome::kAdded);
  EXPECT_EQ(drawing.cancel(), Outcome::kCancelled);
  EXPECT_TRUE(drawing.corners().empty());
  EXPECT_EQ(drawing.closed().size(), 3u);
}

TEST(PolygonDrawing, AreaDoesNotDependOnDirectionOrPlace) {
  const std::vector<Point2> square{{100, 100}, {110, 100}, {110, 110}, {100, 110}};
  const std::vector<Point2> reversed(square.rbegin(), square.rend());
  EXPECT_DOUBLE_EQ(area_px2(square), 100);
  EXPECT_DOUBLE_EQ(area_px2(reversed), 100);
}

}  // namespace
}  // namespace atom_rviz
