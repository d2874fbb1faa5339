#include "atom_core/urdf.h"

#include <console_bridge/console.h>
#include <urdf_model/model.h>
#include <urdf_parser/urdf_parser.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <exception>
#include <mutex>
#include <string>

namespace atom_core {
namespace {

/// Takes over the console of urdfdom for its lifetime and keeps what is said.
class ConsoleCapture : public console_bridge::OutputHandler {
 public:
  ConsoleCapture()
      : previous_handler_(console_bridge::getOutputHandler()),
        previous_level_(console_bridge::getLogLevel()) {
    console_bridge::useOutputHandler(this);
    // A program may have silenced the console; the reasons of a refusal are wanted all the same.
    console_bridge::setLogLevel(console_bridge::CONSOLE_BRIDGE_LOG_WARN);
  }

  ~ConsoleCapture() override {
    console_bridge::setLogLevel(previous_level_);
    console_bridge::useOutputHandler(previous_handler_);
  }

  ConsoleCapture(const ConsoleCapture&) = delete;
  ConsoleCapture& operator=(const ConsoleCapture&) = delete;

  void log(const std::string& text, console_bridge::LogLevel level, const char* /*filename*/,
           int /*line*/) override {
    const bool is_error = level >= console_bridge::CONSOLE_BRIDGE_LOG_ERROR;
    (is_error ? errors_ : warnings_).push_back(text);
  }

  const std::vector<std::string>& errors() const { return errors_; }
  const std::vector<std::string>& warnings() const { return warnings_; }

 private:
  console_bridge::OutputHandler* const previous_handler_;
  const console_bridge::LogLevel previous_level_;
  std::vector<std::string> errors_;
  std::vector<std::string> warnings_;
};

/// Joins the messages to one line: "first; second".
std::string JoinToOneLine(const std::vector<std::string>& messages) {
  std::string line;
  for (const std::string& message : messages) {
    if (!line.empty()) line += "; ";
    line += message;
  }
  for (char& c : line) {
    if (c == '\n' || c == '\r') c = ' ';
  }
  return line;
}

const char* TypeName(const urdf::Joint& joint) {
  switch (joint.type) {
    case urdf::Joint::REVOLUTE:
      return "revolute";
    case urdf::Joint::CONTINUOUS:
      return "continuous";
    case urdf::Joint::PRISMATIC:
      return "prismatic";
    case urdf::Joint::FLOATING:
      return "floating";
    case urdf::Joint::PLANAR:
      return "planar";
    case urdf::Joint::FIXED:
      return "fixed";
    default:
      return "unknown";
  }
}

Eigen::Vector3d ToEigen(const urdf::Vector3& v) { return Eigen::Vector3d(v.x, v.y, v.z); }

UrdfJoint ToPlain(const urdf::Joint& source) {
  const urdf::Pose& origin = source.parent_to_joint_origin_transform;
  UrdfJoint joint;
  joint.name = source.name;
  joint.type = TypeName(source);
  joint.parent_link = source.parent_link_name;
  joint.child_link = source.child_link_name;
  joint.parent_t_child = ToEigen(origin.position);
  joint.parent_q_child = Eigen::Quaterniond(origin.rotation.w, origin.rotation.x, origin.rotation.y,
                                            origin.rotation.z);
  joint.axis = ToEigen(source.axis);
  if (source.limits) {
    joint.limits = UrdfLimits{source.limits->lower, source.limits->upper, source.limits->effort,
                              source.limits->velocity};
  }
  if (source.mimic) {
    joint.mimic =
        UrdfMimic{source.mimic->joint_name, source.mimic->multiplier, source.mimic->offset};
  }
  return joint;
}

/// Beyond it urdfdom's parser takes time that grows with the square of the text, or overflows its
/// stack. The same as in io/xml_text.py, which looks no farther than the first flaw.
constexpr int kDeepest = 250;

/// Moves past what begins at `place` with `begin`, to the end of its `end` or of the text.
bool Skip(const std::string& xml, const char* begin, const char* end, size_t* place) {
  if (xml.compare(*place, std::strlen(begin), begin) != 0) return false;
  const size_t found = xml.find(end, *place + std::strlen(begin));
  *place = found == std::string::npos ? xml.size() : found + std::strlen(end);
  return true;
}

/// Returns where the tag that begins at `place` ends: at its '>', or, without one, where the next
/// tag begins. A '>' within quotes, where no '<' may stand, is none.
size_t EndOfTag(const std::string& xml, size_t place) {
  char quote = 0;
  for (size_t i = place + 1; i < xml.size(); ++i) {
    const char c = xml[i];
    if (c == '<' || (c == '>' && quote == 0)) return i;
    if (c == quote) {
      quote = 0;
    } else if (quote == 0 && (c == '"' || c == '\'')) {
      quote = c;
    }
  }
  return xml.size();
}

/// Tells whether more tags are open at a place than any description has, also in what is no XML.
bool IsTooDeep(const std::string& xml) {
  int depth = 0;
  for (size_t place = xml.find('<'); place < xml.size(); place = xml.find('<', place)) {
    if (Skip(xml, "<!--", "-->", &place) || Skip(xml, "<![CDATA[", "]]>", &place) ||
        Skip(xml, "<?", "?>", &place)) {
      continue;
    }
    if (Skip(xml, "</", ">", &place)) {
      depth = std::max(depth - 1, 0);
      continue;
    }
    const size_t end = EndOfTag(xml, place);
    if (end == xml.size()) break;
    if (xml[end - 1] != '/' && xml[place + 1] != '!') ++depth;
    if (depth > kDeepest) return true;
    place = end;
  }
  return false;
}

UrdfModel ToPlain(const urdf::ModelInterface& source) {
  UrdfModel model;
  model.name = source.getName();
  model.root_link = source.getRoot()->name;
  for (const auto& item : source.links_) model.links.push_back(item.first);
  for (const auto& item : source.joints_) model.joints.push_back(ToPlain(*item.second));
  return model;
}

}  // namespace

Eigen::Matrix4d UrdfJoint::ParentTChild() const {
  Eigen::Matrix4d parent_T_child = Eigen::Matrix4d::Identity();
  parent_T_child.topLeftCorner<3, 3>() = parent_q_child.toRotationMatrix();
  parent_T_child.topRightCorner<3, 1>() = parent_t_child;
  return parent_T_child;
}

Eigen::Vector3d UrdfJoint::OriginRpy() const {
  // urdfdom's own getRPY() snaps to pitch = pi/2 from 0.26 degrees away, so it is not used. Here
  // the yaw is taken first and undone, so that near pitch = +-pi/2, where yaw alone is ill
  // determined, its error is made good by the roll: the three angles together always give R back.
  const Eigen::Matrix3d R = parent_q_child.toRotationMatrix();
  const double cos_pitch = std::hypot(R(0, 0), R(1, 0));
  const double yaw = cos_pitch > 1e-15 ? std::atan2(R(1, 0), R(0, 0)) : 0.0;
  const double c = std::cos(yaw);
  const double s = std::sin(yaw);
  const double pitch = std::atan2(-R(2, 0), c * R(0, 0) + s * R(1, 0));
  const double roll = std::atan2(s * R(0, 2) - c * R(1, 2), c * R(1, 1) - s * R(0, 1));
  return Eigen::Vector3d(roll, pitch, yaw).array() + 0.0;  // + 0.0: no negative zeros
}

UrdfModel ParseUrdf(const std::string& xml) {
  static std::mutex console_mutex;
  const std::lock_guard<std::mutex> lock(console_mutex);
  ConsoleCapture console;

  if (IsTooDeep(xml)) {
    throw UrdfError("more than " + std::to_string(kDeepest) + " tags stand within one another");
  }
  urdf::ModelInterfaceSharedPtr parsed;
  try {
    parsed = urdf::parseURDF(xml);
  } catch (const std::exception& error) {
    throw UrdfError(error.what());
  }
  if (!parsed || !parsed->getRoot()) {
    const std::string reasons = JoinToOneLine(console.errors());
    throw UrdfError(reasons.empty() ? "urdfdom gives no reason" : reasons);
  }

  UrdfModel model = ToPlain(*parsed);
  model.warnings = console.warnings();
  // Some malformed parts are logged as errors and left out, but the model is delivered.
  model.warnings.insert(model.warnings.end(), console.errors().begin(), console.errors().end());
  return model;
}

}  // namespace atom_core
