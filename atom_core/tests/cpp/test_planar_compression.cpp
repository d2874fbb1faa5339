#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>

#include "atom_core/planar_compression.h"

namespace atom_core {
namespace {

using LongVector = Eigen::Matrix<long double, Eigen::Dynamic, 1>;
using LongPlane = Eigen::Matrix<long double, 4, 1>;

/// Points of a board with noise, and a plane near to it.
struct Board {
  PointRows points;         // (n, 3) sensor frame, metres
  Eigen::VectorXd weights;  // (n,) 1/m
  Eigen::Vector4d plane;    // (n, d), unit normal
};

Board MakeBoard(int n, double distance, unsigned seed) {
  std::mt19937 generator(seed);
  std::uniform_real_distribution<double> extent(-0.5, 0.5);
  std::uniform_real_distribution<double> weight(50.0, 200.0);
  std::normal_distribution<double> noise(0.0, 0.01);
  const Eigen::Vector3d centre = distance * Eigen::Vector3d(0.8, -0.5, 0.33).normalized();
  const Eigen::Quaterniond rotation(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()));
  Board board{PointRows(n, 3), Eigen::VectorXd(n), Eigen::Vector4d()};
  for (int i = 0; i < n; ++i) {
    const Eigen::Vector3d local(extent(generator), extent(generator), noise(generator));
    board.points.row(i) = (centre + rotation * local).transpose();
    board.weights(i) = weight(generator);
  }
  // A little off the board, as a plane is while a solver is at work.
  const Eigen::Vector3d normal = rotation * Eigen::Vector3d(0.01, -0.02, 1.0).normalized();
  board.plane << normal, -normal.dot(centre) + 0.005;
  return board;
}

/// Residuals w_i (n . q_i + d) in extended precision (n,): the truth to compare with.
LongVector ExactResiduals(const Board& board) {
  const auto n = board.plane.head<3>().cast<long double>();
  const long double d = board.plane(3);
  const LongVector distances = board.points.cast<long double>() * n;
  return board.weights.cast<long double>().array() * (distances.array() + d);
}

/// Half the derivative of the cost by the plane (4,), in extended precision.
LongPlane ExactGradient(const Board& board) {
  const LongVector weighted =
      board.weights.cast<long double>().array() * ExactResiduals(board).array();
  LongPlane gradient;
  gradient << board.points.cast<long double>().transpose() * weighted, weighted.sum();
  return gradient;
}

/// The gradient is A^T r; its error is compared with |A| |r|, not with its own length, which goes
/// to zero at the optimum. (At 100 m the last digit of a coordinate is 1e-14 m, in R and in every
/// other set of doubles, and that is what a vanishing gradient would be divided into.)
void ExpectSameCostAndGradient(const Board& board, const PlaneRows& rows, double tolerance) {
  const LongVector residuals = ExactResiduals(board);
  const Eigen::VectorXd compressed = rows * board.plane;
  const double cost = static_cast<double>(residuals.squaredNorm());
  EXPECT_NEAR(compressed.squaredNorm() / cost, 1.0, tolerance);

  const LongPlane difference =
      (rows.transpose() * compressed).cast<long double>() - ExactGradient(board);
  const PointRows weighted = board.points.array().colwise() * board.weights.array();
  const double scale = std::hypot(weighted.norm(), board.weights.norm()) * std::sqrt(cost);
  EXPECT_LE(static_cast<double>(difference.norm()) / scale, tolerance);
}

TEST(PlanarCompression, KeepsCostAndGradientNearTheSensor) {
  for (const unsigned seed : {1u, 2u, 3u, 4u, 5u}) {
    const Board board = MakeBoard(2000, 2.0, seed);
    ExpectSameCostAndGradient(board, CompressPlanarRows(board.points, board.weights), 1e-12);
  }
}

TEST(PlanarCompression, KeepsCostAndGradientAtAHundredMetres) {
  for (const unsigned seed : {1u, 2u, 3u, 4u, 5u}) {
    const Board board = MakeBoard(2000, 100.0, seed);
    ExpectSameCostAndGradient(board, CompressPlanarRows(board.points, board.weights), 1e-12);
  }
}

TEST(PlanarCompression, HoldsForAnyPlaneNotOnlyTheBoard) {
  Board board = MakeBoard(50, 3.0, 7);
  const PlaneRows rows = CompressPlanarRows(board.points, board.weights);
  std::srand(7);
  for (int i = 0; i < 20; ++i) {
    board.plane = Eigen::Vector4d::Random();
    ExpectSameCostAndGradient(board, rows, 1e-12);
  }
}

TEST(PlanarCompression, FewPointsGiveAsManyRows) {
  for (const int n : {1, 2, 3, 4, 5}) {
    const Board board = MakeBoard(n, 2.0, 11);
    const PlaneRows rows = CompressPlanarRows(board.points, board.weights);
    EXPECT_EQ(rows.rows(), std::min(n, 4));
    ExpectSameCostAndGradient(board, rows, 1e-12);
  }
}

TEST(PlanarCompression, NoPointsGiveNoRows) {
  EXPECT_EQ(CompressPlanarRows(PointRows(0, 3), Eigen::VectorXd(0)).rows(), 0);
}

TEST(PlanarCompression, ZeroWeightsCostNothing) {
  const Board board = MakeBoard(10, 2.0, 13);
  const PlaneRows rows = CompressPlanarRows(board.points, Eigen::VectorXd::Zero(10));
  EXPECT_EQ(rows.norm(), 0.0);
}

TEST(PlanarCompression, PointsOnOneLineAreNoTrouble) {
  Board board = MakeBoard(30, 2.0, 17);
  for (int i = 0; i < 30; ++i) board.points.row(i) << 2.0, 0.1 * i, 0.5;
  ExpectSameCostAndGradient(board, CompressPlanarRows(board.points, board.weights), 1e-12);
}

TEST(PlanarCompression, SegmentsEqualTheSingleSets) {
  const Board board = MakeBoard(40, 4.0, 19);
  const PlaneRows rows = CompressPlanarSegments(board.points, board.weights, {0, 2, 2, 21});
  ASSERT_EQ(rows.rows(), 16);
  const PlaneRows first = CompressPlanarRows(board.points.topRows(2), board.weights.head(2));
  EXPECT_EQ(rows.topRows(2), first);
  EXPECT_EQ(rows.middleRows(2, 6).norm(), 0.0);  // filling of the first and the empty second set
  EXPECT_EQ(rows.middleRows(8, 4),
            CompressPlanarRows(board.points.middleRows(2, 19), board.weights.segment(2, 19)));
  EXPECT_EQ(rows.middleRows(12, 4),
            CompressPlanarRows(board.points.bottomRows(19), board.weights.tail(19)));
}

TEST(PlanarCompression, RefusesMalformedInput) {
  const Board board = MakeBoard(10, 2.0, 23);
  EXPECT_THROW(CompressPlanarRows(board.points, board.weights.head(9)), std::invalid_argument);
  PointRows broken = board.points;
  broken(3, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(CompressPlanarRows(broken, board.weights), std::invalid_argument);
  Eigen::VectorXd infinite = board.weights;
  infinite(0) = std::numeric_limits<double>::infinity();
  EXPECT_THROW(CompressPlanarRows(board.points, infinite), std::invalid_argument);
}

TEST(PlanarCompression, RefusesMalformedSegments) {
  const Board board = MakeBoard(10, 2.0, 29);
  const std::vector<std::vector<std::int64_t>> all_starts = {
      {}, {1, 5}, {0, 5, 4}, {0, 11}, {-1, 3}};
  for (const auto& starts : all_starts) {
    EXPECT_THROW(CompressPlanarSegments(board.points, board.weights, starts),
                 std::invalid_argument);
  }
}

}  // namespace
}  // namespace atom_core
