// The main function of every test program: catkin links gtest without one.

#include <gtest/gtest.h>

// Asked by the leak sanitizer, if there is one: urdfdom's parser keeps the links of a description
// that it refuses.
extern "C" const char* __lsan_default_suppressions();
extern "C" const char* __lsan_default_suppressions() { return "leak:liburdfdom_model"; }

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
