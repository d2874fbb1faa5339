#include "atom_core/planar_compression.h"

#include <Eigen/QR>
#include <algorithm>
#include <stdexcept>
#include <string>

namespace atom_core {
namespace {

using Points = Eigen::Ref<const PointRows>;
using Weights = Eigen::Ref<const Eigen::VectorXd>;

void CheckPointsAndWeights(const Points& points, const Weights& weights) {
  if (points.rows() != weights.size()) {
    throw std::invalid_argument("there are " + std::to_string(points.rows()) + " points but " +
                                std::to_string(weights.size()) + " weights");
  }
  if (!points.allFinite()) throw std::invalid_argument("a point is not finite");
  if (!weights.allFinite()) throw std::invalid_argument("a weight is not finite");
}

void CheckSegmentStarts(const std::vector<std::int64_t>& starts, Eigen::Index number_of_points) {
  if (starts.empty()) {
    if (number_of_points == 0) return;
    throw std::invalid_argument("there are points but no segment that holds them");
  }
  if (starts.front() != 0) throw std::invalid_argument("the first segment must start at row 0");
  if (!std::is_sorted(starts.begin(), starts.end())) {
    throw std::invalid_argument("the segment starts must not decrease");
  }
  if (starts.back() > number_of_points) {
    throw std::invalid_argument("a segment starts at row " + std::to_string(starts.back()) +
                                ", behind the last of " + std::to_string(number_of_points) +
                                " points");
  }
}

/// Centre of the points, weighted with the squares of the weights (1, 3) [m]; zero when all weights
/// are zero.
Eigen::RowVector3d WeightedCentre(const Points& points, const Weights& weights) {
  const Eigen::VectorXd squares = weights.array().square();
  const double total = squares.sum();
  if (!(total > 0.0)) return Eigen::RowVector3d::Zero();
  return squares.transpose() * points / total;
}

/// CompressPlanarRows without the checks.
PlaneRows Compress(const Points& points, const Weights& weights) {
  const Eigen::Index n = points.rows();
  if (n == 0) return PlaneRows(0, 4);

  // r_i = w_i ((n . c + d) + n . (q_i - c)): linear in (n . c + d, n). About the centre c these two
  // parts are nearly orthogonal and the second is small, so the distance of the board from the
  // sensor does not eat digits of the spread of the points, as it would with [w q, w].
  const Eigen::RowVector3d centre = WeightedCentre(points, weights);
  Eigen::MatrixXd centred(n, 4);
  centred.col(0) = weights;
  centred.rightCols<3>() =
      ((points.rowwise() - centre).array().colwise() * weights.array()).matrix();

  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(centred);
  const Eigen::Index k = std::min<Eigen::Index>(n, 4);
  Eigen::MatrixXd r = qr.matrixQR().topRows(k).triangularView<Eigen::Upper>();
  for (Eigen::Index i = 0; i < k; ++i) {  // the sign of a row is free: settle it
    if (r(i, i) < 0.0) r.row(i) *= -1.0;
  }

  // Back from (n . c + d, n) to (n, d).
  PlaneRows rows(k, 4);
  rows.leftCols<3>() = r.rightCols<3>() + r.col(0) * centre;
  rows.col(3) = r.col(0);
  return rows;
}

}  // namespace

PlaneRows CompressPlanarRows(const Points& points, const Weights& weights) {
  CheckPointsAndWeights(points, weights);
  return Compress(points, weights);
}

PlaneRows CompressPlanarSegments(const Points& points, const Weights& weights,
                                 const std::vector<std::int64_t>& segment_starts) {
  CheckPointsAndWeights(points, weights);
  CheckSegmentStarts(segment_starts, points.rows());

  const Eigen::Index m = static_cast<Eigen::Index>(segment_starts.size());
  PlaneRows rows = PlaneRows::Zero(4 * m, 4);
  for (Eigen::Index j = 0; j < m; ++j) {
    const Eigen::Index begin = segment_starts[j];
    const Eigen::Index end = j + 1 < m ? segment_starts[j + 1] : points.rows();
    const PlaneRows segment =
        Compress(points.middleRows(begin, end - begin), weights.segment(begin, end - begin));
    rows.middleRows(4 * j, segment.rows()) = segment;
  }
  return rows;
}

}  // namespace atom_core
