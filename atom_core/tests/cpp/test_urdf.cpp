#include <console_bridge/console.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <sstream>

#include "atom_core/urdf.h"

namespace atom_core {
namespace {

constexpr double kPi = 3.14159265358979323846;

std::string Robot(const std::string& content) {
  return "<robot name=\"rig\">" + content + "</robot>";
}

std::string Link(const std::string& name) { return "<link name=\"" + name + "\"/>"; }

std::string Joint(const std::string& name, const std::string& parent, const std::string& child,
                  const std::string& content = "", const std::string& type = "fixed") {
  return "<joint name=\"" + name + "\" type=\"" + type + "\"><parent link=\"" + parent +
         "\"/><child link=\"" + child + "\"/>" + content + "</joint>";
}

/// Message of the UrdfError that `xml` provokes; empty when it is accepted.
std::string Refusal(const std::string& xml) {
  try {
    ParseUrdf(xml);
  } catch (const UrdfError& error) {
    return error.what();
  }
  return "";
}

Eigen::Matrix3d RotationFromRpy(const Eigen::Vector3d& rpy) {
  return (Eigen::AngleAxisd(rpy(2), Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(rpy(1), Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(rpy(0), Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}

UrdfJoint JointWithRpy(const Eigen::Vector3d& rpy) {
  std::ostringstream text;
  text.precision(17);
  text << "<origin xyz=\"1 2 3\" rpy=\"" << rpy(0) << " " << rpy(1) << " " << rpy(2) << "\"/>";
  return ParseUrdf(Robot(Link("a") + Link("b") + Joint("j", "a", "b", text.str()))).joints.at(0);
}

TEST(Urdf, ReadsTheTree) {
  const UrdfModel model =
      ParseUrdf(Robot(Link("base") + Link("arm") + Link("tip") + Joint("shoulder", "base", "arm") +
                      Joint("wrist", "arm", "tip")));
  EXPECT_EQ(model.name, "rig");
  EXPECT_EQ(model.root_link, "base");
  EXPECT_EQ(model.links, (std::vector<std::string>{"arm", "base", "tip"}));
  ASSERT_EQ(model.joints.size(), 2u);
  EXPECT_EQ(model.joints[0].name, "shoulder");
  EXPECT_EQ(model.joints[0].type, "fixed");
  EXPECT_EQ(model.joints[0].parent_link, "base");
  EXPECT_EQ(model.joints[0].child_link, "arm");
  EXPECT_TRUE(model.joints[0].ParentTChild().isIdentity(0.0));
  EXPECT_FALSE(model.joints[0].limits.has_value());
  EXPECT_TRUE(model.warnings.empty());
}

TEST(Urdf, ReadsAMovingJoint) {
  const std::string content =
      "<axis xyz=\"0 3 4\"/><limit lower=\"-1\" upper=\"2\" effort=\"5\" velocity=\"6\"/>"
      "<mimic joint=\"j\" multiplier=\"-2\" offset=\"0.5\"/>";
  const UrdfJoint joint =
      ParseUrdf(Robot(Link("a") + Link("b") + Joint("j", "a", "b", content, "prismatic")))
          .joints.at(0);
  EXPECT_EQ(joint.type, "prismatic");
  EXPECT_EQ(joint.axis, Eigen::Vector3d(0, 3, 4));
  EXPECT_EQ(joint.limits->lower, -1.0);
  EXPECT_EQ(joint.limits->upper, 2.0);
  EXPECT_EQ(joint.mimic->joint_name, "j");
  EXPECT_EQ(joint.mimic->multiplier, -2.0);
  EXPECT_EQ(joint.mimic->offset, 0.5);
}

TEST(Urdf, RpyTurnsAboutFixedAxes) {
  const Eigen::Vector3d rpy(0.3, -0.8, 2.1);
  const Eigen::Matrix4d parent_T_child = JointWithRpy(rpy).ParentTChild();
  const Eigen::Matrix3d rotation = parent_T_child.topLeftCorner<3, 3>();
  EXPECT_TRUE(rotation.isApprox(RotationFromRpy(rpy), 1e-14));
  const Eigen::Vector3d translation = parent_T_child.topRightCorner<3, 1>();
  EXPECT_EQ(translation, Eigen::Vector3d(1, 2, 3));
}

TEST(Urdf, RpyGivesTheRotationBackNearAndAtTheSingularPitch) {
  for (const double offset : {0.0, 1e-16, 1e-12, 1e-9, 1e-8, 1e-6, 1e-4, 4e-3, 0.1}) {
    for (const double sign : {-1.0, 1.0}) {
      const UrdfJoint joint = JointWithRpy(Eigen::Vector3d(0.4, sign * (kPi / 2 - offset), -1.2));
      const Eigen::Matrix3d rotation = joint.ParentTChild().topLeftCorner<3, 3>();
      EXPECT_LT((RotationFromRpy(joint.OriginRpy()) - rotation).norm(), 1e-14) << offset;
    }
  }
}

TEST(Urdf, RefusesInTheWordsOfUrdfdom) {
  EXPECT_EQ(Refusal(Robot(Link("a") + Link("b"))),
            "Failed to find root link: Two root links found: [a] and [b]");
  EXPECT_NE(Refusal(Robot(Link("a") + Joint("j", "a", "b"))).find("child link [b] of joint [j]"),
            std::string::npos);
  const std::string bad_number = "<origin xyz=\"1 2 zz\"/>";
  EXPECT_NE(Refusal(Robot(Link("a") + Link("b") + Joint("j", "a", "b", bad_number)))
                .find("Malformed parent origin element for joint [j]"),
            std::string::npos);
}

TEST(Urdf, RefusesWhatIsNoDescriptionOnOneLine) {
  for (const std::string& text :
       {std::string(), std::string("hello"), std::string("<robot name='r'>\n<link"),
        std::string("<foo/>"), Robot(""),
        Robot(Link("a") + Link("b") + Joint("j", "a", "b") + Joint("k", "b", "a"))}) {
    const std::string message = Refusal(text);
    EXPECT_FALSE(message.empty()) << text;
    EXPECT_EQ(message.find('\n'), std::string::npos) << text;
  }
}

std::string Repeated(const std::string& text, int times) {
  std::string all;
  for (int i = 0; i < times; ++i) all += text;
  return all;
}

TEST(Urdf, RefusesTagsThatStandTooDeepWithinOneAnother) {
  const std::string deep = "tags stand within one another";
  EXPECT_NE(Refusal(Repeated("<robot name='r'>", 100000)).find(deep), std::string::npos);
  // What is no XML in its middle made urdfdom take minutes.
  const std::string open = "<?xml version=\"1.0\"?><robot name='r'><link name='a'/>< name=\"k\"&";
  EXPECT_NE(Refusal(Repeated(open, 50000)).find(deep), std::string::npos);
}

TEST(Urdf, TakesManyTagsAfterOneAnother) {
  std::string parts = Link("a");
  for (int i = 0; i < 2000; ++i) {
    const std::string name = "l" + std::to_string(i);
    parts += Link(name) + Joint("j" + std::to_string(i), "a", name);
  }
  parts +=
      "<!-- " + Repeated("<a> ", 1000) + "-->" + Repeated("<gazebo><b c='1>0'/></gazebo>", 500);
  EXPECT_EQ(ParseUrdf(Robot(parts)).joints.size(), 2000u);
}

TEST(Urdf, KeepsRemarksOnAcceptedText) {
  const UrdfModel model =
      ParseUrdf(Robot("<link name=\"a\"><visual><geometry><box size=\"1 1\"/></geometry></visual>"
                      "</link>"));
  EXPECT_FALSE(model.warnings.empty());
}

class CountingHandler : public console_bridge::OutputHandler {
 public:
  void log(const std::string&, console_bridge::LogLevel, const char*, int) override { ++count; }
  int count = 0;
};

TEST(Urdf, LeavesTheConsoleAsItWas) {
  CountingHandler handler;
  console_bridge::useOutputHandler(&handler);
  console_bridge::setLogLevel(console_bridge::CONSOLE_BRIDGE_LOG_NONE);

  EXPECT_NE(Refusal("hello"), "");

  EXPECT_EQ(handler.count, 0);
  EXPECT_EQ(console_bridge::getOutputHandler(), &handler);
  EXPECT_EQ(console_bridge::getLogLevel(), console_bridge::CONSOLE_BRIDGE_LOG_NONE);
  console_bridge::restorePreviousOutputHandler();
  console_bridge::setLogLevel(console_bridge::CONSOLE_BRIDGE_LOG_WARN);
}

}  // namespace
}  // namespace atom_core
