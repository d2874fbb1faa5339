// Layers, rectangles and boards in exact scans: a wall behind a board, seen by a spinning LiDAR.

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "atom_core/board_rectangle.h"
#include "atom_core/board_segmentation.h"
#include "atom_core/scan_layers.h"

namespace atom_core {
namespace {

constexpr int kLayers = 16, kSteps = 900;
constexpr double kWall = 4.0;  // [m]
const Eigen::Vector2d kSize(0.8, 0.6);

// A board 2 m away, rolled by 30 degrees, looking at the sensor.
Eigen::Isometry3d Board() {
  Eigen::Isometry3d sensor_T_board = Eigen::Isometry3d::Identity();
  sensor_T_board.translation() << 2.0, 0.1, 0.05;
  sensor_T_board.linear() = (Eigen::AngleAxisd(M_PI / 2.0, Eigen::Vector3d::UnitY()) *
                             Eigen::AngleAxisd(M_PI / 6.0, Eigen::Vector3d::UnitZ()))
                                .toRotationMatrix();
  return sensor_T_board;
}

struct Cloud {
  PointRows points{kLayers * kSteps, 3};
  CloudLayout layout;
};

// Beams to the wall x = kWall or, backwards, to a sphere around the sensor; and to the board.
Cloud MakeCloud(bool with_board) {
  Cloud cloud;
  const Eigen::Isometry3d board = Board();
  const Eigen::Vector3d normal = board.linear().col(2);
  for (int k = 0; k < kLayers * kSteps; ++k) {
    const double elevation = (-15.0 + 2.0 * (k / kSteps)) * M_PI / 180.0;
    const double azimuth = -M_PI + 2.0 * M_PI * (k % kSteps) / kSteps;
    const Eigen::Vector3d beam(std::cos(elevation) * std::cos(azimuth),
                               std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
    double range = beam.x() > 0.4 ? kWall / beam.x() : 10.0;
    const double to_board = normal.dot(board.translation()) / normal.dot(beam);
    const Eigen::Vector3d on_board = board.inverse() * Eigen::Vector3d(beam * to_board);
    if (with_board && to_board > 0 && std::abs(on_board.x()) < kSize.x() / 2.0 &&
        std::abs(on_board.y()) < kSize.y() / 2.0) {
      range = to_board;
    }
    cloud.points.row(k) = range * beam;
    cloud.layout.ring.push_back(k / kSteps);
  }
  return cloud;
}

BoardOptions Options() {
  BoardOptions options;
  options.size = kSize;
  return options;
}

TEST(ScanLayers, AreFoundWithAndWithoutRings) {
  const Cloud cloud = MakeCloud(true);
  for (const CloudLayout& layout : {cloud.layout, CloudLayout()}) {
    const Scan scan = FindLayers(cloud.points, layout);
    ASSERT_TRUE(scan.has_layers);
    ASSERT_EQ(scan.layer_elevation.size(), static_cast<std::size_t>(kLayers));
    EXPECT_NEAR(scan.layer_elevation.front(), -15.0 * M_PI / 180.0, 1e-9);
    EXPECT_NEAR(scan.azimuth_step, 2.0 * M_PI / kSteps, 1e-9);
    for (const ScanPoint& point : scan.points) {
      EXPECT_EQ(point.layer, point.index / kSteps);
    }
  }
}

TEST(ScanLayers, DirectionUndoesAzimuthAndElevation) {
  const Cloud cloud = MakeCloud(true);
  const Scan scan = FindLayers(cloud.points, cloud.layout);
  for (std::size_t i = 0; i < scan.points.size(); i += 997) {
    const ScanPoint& point = scan.points[i];
    const Eigen::Vector3d beam = scan.Direction(point.azimuth, point.elevation);
    EXPECT_NEAR((beam * point.range - point.position).norm(), 0.0, 1e-9);
  }
}

TEST(ScanLayers, InvalidPointsAreLeftOut) {
  Cloud cloud = MakeCloud(false);
  cloud.points.row(3).setZero();
  cloud.points(7, 1) = std::numeric_limits<double>::quiet_NaN();
  const Scan scan = FindLayers(cloud.points, cloud.layout);
  ASSERT_EQ(scan.points.size(), static_cast<std::size_t>(kLayers * kSteps - 2));
  EXPECT_EQ(scan.points[3].index, 4);
}

TEST(ScanLayers, RefuseAnotherNumberOfRings) {
  Cloud cloud = MakeCloud(false);
  cloud.layout.ring.pop_back();
  EXPECT_THROW(FindLayers(cloud.points, cloud.layout), std::invalid_argument);
}

TEST(BoardRectangle, DistanceIsNegativeInsideAndEuclideanOutside) {
  const Eigen::Vector2d half(2.0, 1.0);
  EXPECT_DOUBLE_EQ(SignedDistance({0.0, 0.0}, half), -1.0);
  EXPECT_DOUBLE_EQ(SignedDistance({2.0, 0.5}, half), 0.0);
  EXPECT_DOUBLE_EQ(SignedDistance({5.0, 5.0}, half), 5.0);
}

TEST(BoardRectangle, IsFoundFromItsBorder) {
  const Eigen::Vector2d half(0.4, 0.3), centre(0.2, -0.1);
  const Eigen::Rotation2Dd turn(0.7);
  Outline outline;
  for (int k = 0; k < 40; ++k) {
    const double s = -1.0 + 2.0 * (k % 10) / 9.0;
    const Eigen::Vector2d side = k / 10 == 0   ? Eigen::Vector2d(s * half.x(), half.y())
                                 : k / 10 == 1 ? Eigen::Vector2d(s * half.x(), -half.y())
                                 : k / 10 == 2 ? Eigen::Vector2d(half.x(), s * half.y())
                                               : Eigen::Vector2d(-half.x(), s * half.y());
    outline.limits.push_back(centre + turn * side);
  }
  outline.inside = outline.limits;
  const RectanglePose pose = FitRectangle(outline, half);
  EXPECT_NEAR((pose.centre - centre).norm(), 0.0, 2e-3);
  EXPECT_NEAR(std::remainder(pose.angle - 0.7, M_PI), 0.0, 5e-3);
  const Eigen::Vector2d size = MeasureSize(outline.limits, pose, half);
  EXPECT_NEAR(size.x(), 0.8, 4e-3);
  EXPECT_NEAR(size.y(), 0.6, 4e-3);
}

TEST(BoardRectangle, LiesInTheMiddleOfWhatLayersAlongItsSideAllow) {
  const Eigen::Vector2d half(0.4, 0.3);
  Outline outline;  // ends of six layers 0.1 m apart; the next ones, 0.1 m farther, pass the board
  for (int layer = 0; layer < 6; ++layer) {
    for (const double x : {-0.4, 0.4}) outline.limits.emplace_back(x, 0.1 * layer - 0.25);
  }
  outline.inside = outline.limits;
  for (const double y : {-0.35, 0.35}) outline.outside.emplace_back(0.0, y);
  RectanglePose pose = FitRectangle(outline, half);
  for (const double off : {-0.04, 0.0, 0.04}) {
    pose.angle = 0.0;
    pose.centre = {0.0, off};
    pose.cost = 0.0;
    const RectanglePose moved = InMiddle(outline, half, pose);
    EXPECT_NEAR(moved.centre.x(), 0.0, 1e-3);
    EXPECT_NEAR(moved.centre.y(), 0.0, 3e-3);
  }
}

TEST(BoardSegmentation, LabelsExactlyTheReturnsOfTheBoard) {
  const Cloud cloud = MakeCloud(true);
  const Scan scan = FindLayers(cloud.points, cloud.layout);
  const BoardSegment board = SegmentBoard(scan, Eigen::Vector3d(2.1, 0.2, 0.0), Options());
  ASSERT_TRUE(board.detected) << board.reason;
  std::size_t truly = 0;
  const Cloud empty = MakeCloud(false);
  for (int k = 0; k < kLayers * kSteps; ++k) {
    if (cloud.points.row(k) != empty.points.row(k)) ++truly;
  }
  EXPECT_EQ(board.indices.size(), truly);
  for (const auto index : board.indices) {
    EXPECT_NE(cloud.points.row(index), empty.points.row(index));
  }
  EXPECT_LT((board.sensor_T_board.topRightCorner<3, 1>() - Board().translation()).norm(), 0.02);
}

TEST(BoardSegmentation, IsTheSameEachTime) {
  const Cloud cloud = MakeCloud(true);
  const Scan scan = FindLayers(cloud.points, cloud.layout);
  const Eigen::Vector3d seed(2.1, 0.2, 0.0);
  const BoardSegment first = SegmentBoard(scan, seed, Options());
  SegmentBoard(scan, Eigen::Vector3d(4.0, 0.0, 0.0), Options());
  const BoardSegment second = SegmentBoard(scan, seed, Options());
  EXPECT_EQ(first.indices, second.indices);
  EXPECT_EQ(first.limit_indices, second.limit_indices);
}

TEST(BoardSegmentation, AWallIsNoBoard) {
  const Cloud cloud = MakeCloud(false);
  const Scan scan = FindLayers(cloud.points, cloud.layout);
  const BoardSegment wall = SegmentBoard(scan, Eigen::Vector3d(4.0, 0.0, 0.0), Options());
  EXPECT_FALSE(wall.detected);
  EXPECT_FALSE(wall.reason.empty());
  for (const BoardSegment& board : FindBoards(scan, Options())) EXPECT_FALSE(board.detected);
}

TEST(BoardSegmentation, SearchFindsTheBoardWithoutASeed) {
  const Cloud cloud = MakeCloud(true);
  const Scan scan = FindLayers(cloud.points, cloud.layout);
  const std::vector<BoardSegment> boards = FindBoards(scan, Options());
  ASSERT_EQ(boards.size(), 1u);
  EXPECT_LT((boards[0].sensor_T_board.topRightCorner<3, 1>() - Board().translation()).norm(), 0.02);
}

TEST(BoardSegmentation, RefusesSizesAndSeedsThatAreNone) {
  const Cloud cloud = MakeCloud(true);
  const Scan scan = FindLayers(cloud.points, cloud.layout);
  EXPECT_THROW(SegmentBoard(scan, Eigen::Vector3d::Ones(), BoardOptions()), std::invalid_argument);
  const Eigen::Vector3d nowhere = Eigen::Vector3d::Constant(std::nan(""));
  EXPECT_THROW(SegmentBoard(scan, nowhere, Options()), std::invalid_argument);
}

}  // namespace
}  // namespace atom_core
