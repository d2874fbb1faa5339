// Whether a node runs, by the services that the master knows.
#include <gtest/gtest.h>

#include "logic/presence.h"

namespace atom_rviz {
namespace {

const std::string kNode = "/collect_data/";
const std::string kSave = "/collect_data/save_collection";

TEST(Presence, ANodeThatServesRuns) {
  const auto now = presence_of(kNode, kSave, {{kSave, true}, {first_service(kNode), true}});
  EXPECT_EQ(now, Presence::kRunning);
}

TEST(Presence, OneThatWaitsForItsSensorsIsThere) {
  const auto now = presence_of(kNode, kSave, {{kSave, false}, {first_service(kNode), true}});
  EXPECT_EQ(now, Presence::kStarting) << "nobody shall start a second one";
}

TEST(Presence, OneOfWhichTheMasterKnowsNothingIsAbsent) {
  EXPECT_EQ(presence_of(kNode, kSave, {{kSave, false}, {first_service(kNode), false}}),
            Presence::kAbsent);
  EXPECT_EQ(presence_of(kNode, kSave, {}), Presence::kAbsent);
}

}  // namespace
}  // namespace atom_rviz
