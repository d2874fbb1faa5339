// The compiled part of atom_core for Python: `atom_core._core`, imported only by
// atom_core/native.py.

#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <vector>

#include "atom_core/planar_compression.h"
#include "atom_core/urdf.h"
#include "bindings.h"

namespace py = pybind11;

namespace atom_core {
namespace {

using DoubleArray = py::array_t<double, py::array::c_style | py::array::forcecast>;
using IndexArray = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>;
using PointMap = Eigen::Map<const PointRows>;
using VectorMap = Eigen::Map<const Eigen::VectorXd>;

std::string ShapeText(const py::array& array) {
  return py::str(py::object(array.attr("shape"))).cast<std::string>();
}

PointMap AsPoints(const DoubleArray& points) {
  if (points.ndim() != 2 || points.shape(1) != 3) {
    throw std::invalid_argument("points must have the shape (n, 3), not " + ShapeText(points));
  }
  return PointMap(points.data(), points.shape(0), 3);
}

VectorMap AsWeights(const DoubleArray& weights) {
  if (weights.ndim() != 1) {
    throw std::invalid_argument("weights must have the shape (n,), not " + ShapeText(weights));
  }
  return VectorMap(weights.data(), weights.shape(0));
}

std::vector<std::int64_t> AsStarts(const IndexArray& starts) {
  if (starts.ndim() != 1) {
    throw std::invalid_argument("starts must have the shape (m,), not " + ShapeText(starts));
  }
  return std::vector<std::int64_t>(starts.data(), starts.data() + starts.shape(0));
}

py::array_t<double> ToArray(const PlaneRows& rows, const std::vector<Py_ssize_t>& shape) {
  py::array_t<double> array(shape);
  if (rows.size() > 0) std::memcpy(array.mutable_data(), rows.data(), rows.size() * sizeof(double));
  return array;
}

py::array_t<double> CompressRows(const DoubleArray& points, const DoubleArray& weights) {
  const PointMap point_rows = AsPoints(points);
  const VectorMap weight_vector = AsWeights(weights);
  PlaneRows rows;
  {
    const py::gil_scoped_release release;
    rows = CompressPlanarRows(point_rows, weight_vector);
  }
  return ToArray(rows, {rows.rows(), 4});
}

py::array_t<double> CompressSegments(const DoubleArray& points, const DoubleArray& weights,
                                     const IndexArray& starts) {
  const PointMap point_rows = AsPoints(points);
  const VectorMap weight_vector = AsWeights(weights);
  const std::vector<std::int64_t> segment_starts = AsStarts(starts);
  PlaneRows rows;
  {
    const py::gil_scoped_release release;
    rows = CompressPlanarSegments(point_rows, weight_vector, segment_starts);
  }
  return ToArray(rows, {rows.rows() / 4, 4, 4});
}

py::object LimitsOrNone(const UrdfJoint& joint) {
  if (!joint.limits) return py::none();
  py::dict limits;
  limits["lower"] = joint.limits->lower;
  limits["upper"] = joint.limits->upper;
  limits["effort"] = joint.limits->effort;
  limits["velocity"] = joint.limits->velocity;
  return limits;
}

py::object MimicOrNone(const UrdfJoint& joint) {
  if (!joint.mimic) return py::none();
  py::dict mimic;
  mimic["joint"] = joint.mimic->joint_name;
  mimic["multiplier"] = joint.mimic->multiplier;
  mimic["offset"] = joint.mimic->offset;
  return mimic;
}

py::dict JointToDict(const UrdfJoint& joint) {
  py::dict item;
  item["name"] = joint.name;
  item["type"] = joint.type;
  item["parent_link"] = joint.parent_link;
  item["child_link"] = joint.child_link;
  item["origin_xyz"] = joint.parent_t_child;
  item["origin_rpy"] = joint.OriginRpy();
  item["origin_quaternion_xyzw"] = Eigen::Vector4d(joint.parent_q_child.coeffs());
  item["parent_T_child_at_zero"] = joint.ParentTChild();
  item["axis"] = joint.axis;
  item["limits"] = LimitsOrNone(joint);
  item["mimic"] = MimicOrNone(joint);
  return item;
}

py::dict ParseUrdfToDict(const std::string& xml) {
  const UrdfModel model = ParseUrdf(xml);
  py::list joints;
  for (const UrdfJoint& joint : model.joints) joints.append(JointToDict(joint));
  py::dict robot;
  robot["name"] = model.name;
  robot["root_link"] = model.root_link;
  robot["links"] = model.links;
  robot["joints"] = joints;
  robot["warnings"] = model.warnings;
  return robot;
}

void BindUrdf(py::module& m) {
  py::register_exception<UrdfError>(m, "UrdfError", PyExc_ValueError);
  m.def("parse_urdf", &ParseUrdfToDict, py::arg("xml"),
        R"(Parses the text of a URDF with urdfdom, the parser of ROS.

Args:
    xml: text of the URDF (expand a xacro first).

Returns:
    dict with name, root_link, links (sorted names), joints (list of dict, sorted by name) and
    warnings (list of str). A joint has name, type (as in URDF), parent_link, child_link,
    origin_xyz (3,) [m], origin_rpy (3,) [rad, fixed axes: Rz(yaw) Ry(pitch) Rx(roll)],
    origin_quaternion_xyzw (4,), parent_T_child_at_zero (4, 4), axis (3,) in the joint frame as
    written, limits (dict lower, upper, effort, velocity, or None) and mimic (dict joint,
    multiplier, offset, or None).

Raises:
    UrdfError: (a ValueError) urdfdom refuses the text; its own words, on one line.
)");
}

void BindPlanarCompression(py::module& m) {
  m.def("compress_planar_rows", &CompressRows, py::arg("points"), py::arg("weights"),
        R"(Compresses residuals of points to a plane, exactly.

Residual i is weights[i] * (n . points[i] + d) for the plane (n, d).

Args:
    points: (n, 3) in the sensor frame, metres.
    weights: (n,), usually 1 / sigma in 1/m.

Returns:
    (k, 4) with k = min(n, 4): |R @ (n, d)|^2 is the sum of the squared residuals for every (n, d),
    so cost and gradient are those of all the points.

Raises:
    ValueError: wrong shapes, different lengths or a number that is not finite.
)");
  m.def("compress_planar_segments", &CompressSegments, py::arg("points"), py::arg("weights"),
        py::arg("starts"),
        R"(Compresses many sets of points that stand one behind the other; see compress_planar_rows.

Args:
    points: (n, 3) in the sensor frame, metres.
    weights: (n,), usually 1 / sigma in 1/m.
    starts: (m,) first row of each set, not decreasing, beginning with 0; the last set ends at n.

Returns:
    (m, 4, 4), one compressed set each, filled up with zero rows below four points.

Raises:
    ValueError: wrong shapes, lengths or starts, or a number that is not finite.
)");
}

}  // namespace
}  // namespace atom_core

PYBIND11_MODULE(_core, m) {
  m.doc() = "Compiled core of atom_core: robot descriptions, boards in clouds, calibration.";
  atom_core::BindUrdf(m);
  atom_core::BindPlanarCompression(m);
  atom_core::BindBoardSegmentation(m);
  atom_core::BindCalibration(m);
}
