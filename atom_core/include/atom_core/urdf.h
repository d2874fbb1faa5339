/// \file
/// A robot description as plain values, read by urdfdom, the parser that ROS itself uses.
///
/// Using ROS's own parser means that a description is accepted here exactly when RViz and
/// robot_state_publisher accept it, and that what is wrong with it is said in the words a ROS user
/// knows. Nothing here needs a ROS installation beyond the urdfdom library.

#ifndef ATOM_CORE_URDF_H_
#define ATOM_CORE_URDF_H_

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace atom_core {

/// Thrown when a text is no valid URDF; what() is everything urdfdom had to say, on one line.
class UrdfError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Limits of a joint, in rad (revolute), m (prismatic), N m or N, rad/s or m/s.
struct UrdfLimits {
  double lower = 0.0;
  double upper = 0.0;
  double effort = 0.0;
  double velocity = 0.0;
};

/// position = multiplier * (position of the joint called joint_name) + offset.
struct UrdfMimic {
  std::string joint_name;
  double multiplier = 1.0;
  double offset = 0.0;
};

/// One joint: the edge between a parent link and a child link.
struct UrdfJoint {
  std::string name;
  /// As written in a URDF: fixed, revolute, continuous, prismatic, planar or floating.
  std::string type;
  std::string parent_link;
  std::string child_link;
  /// Origin: pose of the child link in the parent link when the joint stands at zero.
  Eigen::Vector3d parent_t_child = Eigen::Vector3d::Zero();  ///< metres
  Eigen::Quaterniond parent_q_child = Eigen::Quaterniond::Identity();
  /// Direction of motion in the joint frame, as written (not normalised); zero when it has none.
  Eigen::Vector3d axis = Eigen::Vector3d::Zero();
  std::optional<UrdfLimits> limits;
  std::optional<UrdfMimic> mimic;

  /// The origin as a 4x4 matrix that maps points in the child link to points in the parent link.
  Eigen::Matrix4d ParentTChild() const;

  /// Roll, pitch, yaw of the origin [rad] about the *fixed* axes of the parent, as in a URDF:
  /// R = Rz(yaw) Ry(pitch) Rx(roll). The three together are exact to rounding, also near
  /// pitch = +-pi/2, where only a combination of roll and yaw is determined.
  Eigen::Vector3d OriginRpy() const;
};

/// A robot: a tree of links joined by joints.
struct UrdfModel {
  std::string name;
  std::string root_link;
  std::vector<std::string> links;     ///< sorted by name
  std::vector<UrdfJoint> joints;      ///< sorted by name
  std::vector<std::string> warnings;  ///< what urdfdom remarked on without refusing the text
};

/// Parses the text of a URDF (not of a xacro: expand that first).
///
/// Console output of urdfdom is caught while parsing and goes into the exception or, when the text
/// is accepted, into UrdfModel::warnings; the previous output handler is back in place afterwards.
/// Calls from several threads wait for each other, because that handler is global to the process.
///
/// \throws UrdfError when urdfdom refuses the text.
UrdfModel ParseUrdf(const std::string& xml);

}  // namespace atom_core

#endif  // ATOM_CORE_URDF_H_
