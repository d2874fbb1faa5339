// Boards in clouds for Python: arrays over once, plain dicts back.

#include "atom_core/board_segmentation.h"

#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <vector>

#include "atom_core/scan_layers.h"
#include "bindings.h"

namespace py = pybind11;

namespace atom_core {
namespace {

using DoubleArray = py::array_t<double, py::array::c_style | py::array::forcecast>;
using IndexArray = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>;

Scan AsScan(const DoubleArray& points, const IndexArray& ring, std::int64_t width,
            std::int64_t height) {
  if (points.ndim() != 2 || points.shape(1) != 3 || ring.ndim() != 1) {
    throw std::invalid_argument("points must have the shape (n, 3) and ring the shape (n,)");
  }
  const Eigen::Map<const PointRows> cloud(points.data(), points.shape(0), 3);
  CloudLayout layout;
  layout.ring.assign(ring.data(), ring.data() + ring.shape(0));
  layout.width = width;
  layout.height = height;
  const py::gil_scoped_release release;
  return FindLayers(cloud, layout);
}

py::array_t<std::int64_t> Array(const std::vector<std::int64_t>& values) {
  return py::array_t<std::int64_t>(static_cast<py::ssize_t>(values.size()), values.data());
}

py::dict ToDict(const BoardSegment& segment) {
  py::dict item;
  item["detected"] = segment.detected;
  item["unsure"] = segment.unsure;
  item["reason"] = segment.reason;
  item["indices"] = Array(segment.indices);
  item["limit_indices"] = Array(segment.limit_indices);
  item["sensor_T_board"] = segment.sensor_T_board;
  item["plane_sigma_m"] = segment.plane_sigma;
  item["border_rms_m"] = segment.border_rms;
  item["incidence_rad"] = segment.incidence;
  item["measured_width_m"] = segment.measured_size.x();
  item["measured_height_m"] = segment.measured_size.y();
  item["point_spacing_m"] = segment.spacing;
  item["layers"] = segment.layers;
  item["expected_points"] = segment.expected_points;
  item["visible"] = segment.visible;
  item["hidden"] = segment.hidden;
  item["through"] = segment.through;
  item["dark"] = segment.dark;
  item["in_view"] = segment.in_view;
  item["score"] = segment.score;
  item["progress"] = segment.progress;
  return item;
}

BoardOptions AsOptions(double width, double height, int least_layers, double beam_width,
                       double dark) {
  const Eigen::Vector2d size(width, height);
  CheckBoardSize(size);
  if (!(beam_width >= 0.0 && beam_width < M_PI)) {
    throw std::invalid_argument("a beam must be narrower than half a turn");
  }
  if (!(dark >= 0.0 && std::isfinite(dark))) {
    throw std::invalid_argument("dark squares must have a size");
  }
  BoardOptions options;
  options.size = size;
  options.least_layers = least_layers;
  options.beam_width = beam_width;
  options.dark = dark;
  return options;
}

py::dict SegmentAt(const Scan& scan, const DoubleArray& seed, double width, double height,
                   int least_layers, double beam_width, double dark) {
  if (seed.ndim() != 1 || seed.shape(0) != 3) {
    throw std::invalid_argument("seed must have the shape (3,)");
  }
  const Eigen::Vector3d point(seed.data()[0], seed.data()[1], seed.data()[2]);
  BoardSegment segment;
  {
    const py::gil_scoped_release release;
    segment = SegmentBoard(scan, point, AsOptions(width, height, least_layers, beam_width, dark));
  }
  return ToDict(segment);
}

py::list Find(const Scan& scan, double width, double height, int least_layers, double beam_width,
              double dark) {
  std::vector<BoardSegment> segments;
  {
    const py::gil_scoped_release release;
    segments = FindBoards(scan, AsOptions(width, height, least_layers, beam_width, dark));
  }
  py::list items;
  for (const BoardSegment& segment : segments) items.append(ToDict(segment));
  return items;
}

IndexArray LayerOfPoints(const Scan& scan, std::int64_t size) {
  const std::int64_t least = scan.points.empty() ? 0 : scan.points.back().index + std::int64_t{1};
  if (size < least) throw std::invalid_argument("size must be the number of the cloud's points");
  IndexArray layers(size);
  std::fill_n(layers.mutable_data(), size, -1);
  for (const ScanPoint& point : scan.points) layers.mutable_data()[point.index] = point.layer;
  return layers;
}

}  // namespace

void BindBoardSegmentation(py::module& m) {
  py::class_<Scan>(m, "Scan", "A cloud with its layers; see find_layers.")
      .def_readonly("azimuth_step", &Scan::azimuth_step, "between neighbours in a layer [rad]")
      .def_readonly("layer_elevation", &Scan::layer_elevation, "ascending [rad]")
      .def_readwrite("has_layers", &Scan::has_layers)
      .def_property_readonly(
          "axis", [](const Scan& scan) { return Eigen::Vector3d(scan.sensor_R_spin.col(2)); })
      .def("layer_of_points", &LayerOfPoints, py::arg("size"),
           "layer of each of the cloud's points (size,), -1 where it is invalid");
  m.def("find_layers", &AsScan, py::arg("points"), py::arg("ring"), py::arg("width"),
        py::arg("height"),
        R"(Finds the layers of a spinning LiDAR's cloud, in any orientation of its frame.

Args:
    points: (n, 3) in the sensor's frame, metres; NaN and zeros are invalid.
    ring: (n,) layer of each point, or (0,) where unknown.
    width, height: organisation of the cloud; height 1 where there is none.

Returns:
    Scan.

Raises:
    ValueError: wrong shapes or lengths.
)");
  m.def("segment_board", &SegmentAt, py::arg("scan"), py::arg("seed"), py::arg("width"),
        py::arg("height"), py::arg("least_layers"), py::arg("beam_width") = 0.0,
        py::arg("dark") = 0.0,
        R"(Finds a board of known size near a seed (3,) [m] in the sensor's frame.

Squares of the side ``dark`` [m] may return nothing.

Returns:
    dict: detected, unsure, reason, indices (n,) and limit_indices (m,) into the cloud, sensor_T_board (4, 4)
    with its origin in the board's middle, and figures: see BoardSegment in board_segmentation.h.

Raises:
    ValueError: a size that is not positive, a seed that is not finite, or a beam as wide as half a
        turn.
)");
  m.def("find_boards", &Find, py::arg("scan"), py::arg("width"), py::arg("height"),
        py::arg("least_layers"), py::arg("beam_width") = 0.0, py::arg("dark") = 0.0,
        "Searches a whole scan for boards of a size; list of dict as segment_board's, best first.");
}

}  // namespace atom_core
