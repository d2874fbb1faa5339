// Names of sensors as ROS has them; test_graph_names.py of atom_calibration has the same examples.
#include <gtest/gtest.h>

#include "logic/graph_name.h"

namespace atom_rviz {
namespace {

TEST(GraphName, WhatRosRefusesIsAnUnderscore) {
  EXPECT_EQ(graph_name("lidar-1.front"), "lidar_1_front");
  EXPECT_EQ(graph_name("3d-lidar"), "3d_lidar");
  EXPECT_EQ(graph_name("a--b.."), "a__b__");
}

TEST(GraphName, OthersStayAsTheyAre) {
  EXPECT_EQ(graph_name("Lidar_1"), "Lidar_1");
  EXPECT_EQ(graph_name(""), "");
}

}  // namespace
}  // namespace atom_rviz
