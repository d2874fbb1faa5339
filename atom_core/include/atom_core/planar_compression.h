/// \file
/// Exact compression of planar residuals: N points on a board become at most four rows.
///
/// A point q_i (metres, in the frame of the sensor) that should lie on the plane pi = (n, d), i.e.
/// n . q + d = 0, has the residual r_i = w_i (n . q_i + d). That is linear in the four numbers of
/// pi, with the N x 4 matrix A whose rows are [w_i q_i^T, w_i]. Any R with R^T R = A^T A has
/// |R pi|^2 = |A pi|^2 = sum_i r_i^2, for *every* pi, so it carries the same cost and the same
/// gradient as the points and a solver never has to visit them again. QR gives such an R with
/// k = min(N, 4) rows. A^T A is never formed: it would square the condition number, which costs
/// half of the digits for points far from the sensor.

#ifndef ATOM_CORE_PLANAR_COMPRESSION_H_
#define ATOM_CORE_PLANAR_COMPRESSION_H_

#include <Eigen/Core>
#include <cstdint>
#include <vector>

namespace atom_core {

/// Points as rows (n, 3), metres; row major, so that a numpy array is used without a copy.
using PointRows = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
/// Rows that multiply a plane (n, d) in the frame of the points.
using PlaneRows = Eigen::Matrix<double, Eigen::Dynamic, 4, Eigen::RowMajor>;

/// Compresses the points of one set.
///
/// \param points (n, 3) in the sensor frame, metres.
/// \param weights (n,), usually 1/sigma in 1/m; residual i is weights[i] (n . q_i + d).
/// \return R (k, 4), k = min(n, 4): |R (n, d)|^2 is the sum of squares, for every (n, d).
///     R is a square root of the cost, not a triangular matrix.
/// \throws std::invalid_argument when the lengths differ or a number is not finite.
PlaneRows CompressPlanarRows(const Eigen::Ref<const PointRows>& points,
                             const Eigen::Ref<const Eigen::VectorXd>& weights);

/// Compresses many sets that stand one behind the other, for instance one per label.
///
/// \param points (n, 3) in the sensor frame, metres.
/// \param weights (n,), see CompressPlanarRows.
/// \param segment_starts (m,) first row of each set, not decreasing, beginning with 0; set j ends
///     where set j + 1 begins, the last one at n. Sets may be empty.
/// \return (4 m, 4): rows 4 j to 4 j + 3 belong to set j, filled up with zero rows when it has
///     fewer than four points (a zero row costs nothing).
/// \throws std::invalid_argument when the lengths differ, a number is not finite or the starts are
///     out of order or out of range.
PlaneRows CompressPlanarSegments(const Eigen::Ref<const PointRows>& points,
                                 const Eigen::Ref<const Eigen::VectorXd>& weights,
                                 const std::vector<std::int64_t>& segment_starts);

}  // namespace atom_core

#endif  // ATOM_CORE_PLANAR_COMPRESSION_H_
