// The reference of `make bench`: the same rows as the solver's, as a straightforward Ceres program.
//
// One automatically differentiated residual per corner or point, board poses eliminated
// (DENSE_SCHUR), one thread. Reads the problem that bench.py writes, prints one line:
// initial cost, final cost, iterations, seconds.

#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <vector>

namespace {

constexpr int kKindReprojection = 0, kKindOrthogonal = 1;

/// One row of the file; numbers as in bench.py.
struct Row {
  double kind, sensor, board;
  double before[12], between[12];  // C0, C1: rotation by rows, translation
  double point[3], measured[2], size[4], sigma;
  double focal[2], centre[2], distortion[5];
};

template <typename T>
void Apply(const double* constant, const T* in, T* out) {
  for (int i = 0; i < 3; ++i) {
    out[i] = T(constant[9 + i]);
    for (int j = 0; j < 3; ++j) out[i] += constant[3 * i + j] * in[j];
  }
}

template <typename T>
void ApplyInverse(const double* constant, const T* in, T* out) {
  for (int i = 0; i < 3; ++i) {
    out[i] = T(0.0);
    for (int j = 0; j < 3; ++j) out[i] += constant[3 * j + i] * (in[j] - constant[9 + j]);
  }
}

template <typename T>
void ApplyPose(const T* pose, const T* in, T* out) {
  ceres::AngleAxisRotatePoint(pose, in, out);
  for (int i = 0; i < 3; ++i) out[i] += pose[3 + i];
}

template <typename T>
void ApplyPoseInverse(const T* pose, const T* in, T* out) {
  const T moved[3] = {in[0] - pose[3], in[1] - pose[4], in[2] - pose[5]};
  const T back[3] = {-pose[0], -pose[1], -pose[2]};
  ceres::AngleAxisRotatePoint(back, moved, out);
}

/// sensor_T_pattern = C0 inverse(X_sensor) C1 X_board.
struct Reprojection {
  Row row;
  template <typename T>
  bool operator()(const T* sensor, const T* board, T* residual) const {
    const T corner[3] = {T(row.point[0]), T(row.point[1]), T(row.point[2])};
    T a[3], b[3], c[3], p[3];
    ApplyPose(board, corner, a);
    Apply(row.between, a, b);
    ApplyPoseInverse(sensor, b, c);
    Apply(row.before, c, p);
    const T x = p[0] / p[2], y = p[1] / p[2], s = x * x + y * y;
    const double* k = row.distortion;
    const T factor = 1.0 + s * (k[0] + s * (k[1] + s * k[4]));
    const T u = x * factor + 2.0 * k[2] * x * y + k[3] * (s + 2.0 * x * x);
    const T v = y * factor + k[2] * (s + 2.0 * y * y) + 2.0 * k[3] * x * y;
    residual[0] = (row.focal[0] * u + row.centre[0] - row.measured[0]) / row.sigma;
    residual[1] = (row.focal[1] * v + row.centre[1] - row.measured[1]) / row.sigma;
    return true;
  }
};

struct Range {
  Row row;
  template <typename T>
  bool operator()(const T* sensor, const T* board, T* residual) const {
    const T point[3] = {T(row.point[0]), T(row.point[1]), T(row.point[2])};
    T a[3], b[3], c[3], p[3];
    ApplyInverse(row.before, point, a);
    ApplyPose(sensor, a, b);
    ApplyInverse(row.between, b, c);
    ApplyPoseInverse(board, c, p);
    if (row.kind == kKindOrthogonal) {
      residual[0] = p[2] / row.sigma;
      return true;
    }
    const T dx = ceres::abs(p[0] - row.size[0]) - row.size[2];
    const T dy = ceres::abs(p[1] - row.size[1]) - row.size[3];
    if (dx > T(0.0) && dy > T(0.0)) {
      residual[0] = ceres::sqrt(dx * dx + dy * dy) / row.sigma;
    } else {
      residual[0] = (dx > dy ? dx : dy) / row.sigma;
    }
    return true;
  }
};

std::vector<double> Read(std::ifstream& file, std::int64_t count) {
  std::vector<double> values(count);
  file.read(reinterpret_cast<char*>(values.data()), count * sizeof(double));
  if (!file) std::exit(2);
  return values;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  std::ifstream file(argv[1], std::ios::binary);
  std::int64_t header[4];  // parameter blocks, first board, first held block, rows
  file.read(reinterpret_cast<char*>(header), sizeof(header));
  std::vector<double> x = Read(file, 6 * header[0]);
  const std::vector<double> numbers =
      Read(file, header[3] * static_cast<std::int64_t>(sizeof(Row) / sizeof(double)));
  const Row* rows = reinterpret_cast<const Row*>(numbers.data());

  const auto began = std::chrono::steady_clock::now();
  ceres::Problem problem;
  auto* ordering = new ceres::ParameterBlockOrdering;
  for (std::int64_t i = 0; i < header[0]; ++i) {
    problem.AddParameterBlock(&x[6 * i], 6);
    ordering->AddElementToGroup(&x[6 * i], i >= header[1] && i < header[2] ? 0 : 1);
    if (i >= header[2]) problem.SetParameterBlockConstant(&x[6 * i]);
  }
  for (std::int64_t i = 0; i < header[3]; ++i) {
    double* sensor = &x[6 * static_cast<std::int64_t>(rows[i].sensor)];
    double* board = &x[6 * static_cast<std::int64_t>(rows[i].board)];
    ceres::CostFunction* cost =
        rows[i].kind == kKindReprojection
            ? static_cast<ceres::CostFunction*>(
                  new ceres::AutoDiffCostFunction<Reprojection, 2, 6, 6>(new Reprojection{rows[i]}))
            : new ceres::AutoDiffCostFunction<Range, 1, 6, 6>(new Range{rows[i]});
    problem.AddResidualBlock(cost, nullptr, sensor, board);
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_SCHUR;
  options.linear_solver_ordering.reset(ordering);
  options.num_threads = 1;
  options.max_num_iterations = 200;
  options.function_tolerance = 1e-5;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - began;
  std::printf("%.6f %.6f %d %.6f\n", summary.initial_cost, summary.final_cost,
              static_cast<int>(summary.iterations.size()) - 1, seconds.count());
  return 0;
}
