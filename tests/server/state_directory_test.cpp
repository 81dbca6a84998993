#include "server/state_directory.h"

#include <gtest/gtest.h>

#include <array>
#include <cstdlib>
#include <map>
#include <string>

namespace cairn::server {
namespace {

// The first of these that is set counts.
constexpr std::array kPlaces = {"CAIRN_STATE", "STATE_DIRECTORY", "XDG_STATE_HOME", "HOME"};

class StateDirectoryTest : public ::testing::Test {
 protected:
  // Nothing of the environment in which the tests run.
  StateDirectoryTest() {
    for (const char* name : kPlaces) {
      if (const char* const value = std::getenv(name)) before_[name] = value;
      unsetenv(name);
    }
  }
  ~StateDirectoryTest() override {
    for (const char* name : kPlaces) unsetenv(name);
    for (const auto& [name, value] : before_) Set(name, value);
  }
  static void Set(const std::string& name, const std::string& value) { setenv(name.c_str(), value.c_str(), 1); }
  static std::string Place(const std::string& typed = {}) {
    const auto place = StateDirectory(typed, 7);
    return place ? place->string() : "none: " + place.error().message;
  }

 private:
  std::map<std::string, std::string> before_;
};

TEST_F(StateDirectoryTest, WhatIsTypedComesBeforeTheEnvironmentAndTheNearestOfThatFirst) {
  EXPECT_EQ(StateDirectory({}, 7).error().code, StatusCode::kInvalidArgument);
  Set("HOME", "/home/ann");
  EXPECT_EQ(Place(), "/home/ann/.local/state/cairn/domain-7");
  Set("XDG_STATE_HOME", "/xdg");
  EXPECT_EQ(Place(), "/xdg/cairn/domain-7");
  Set("STATE_DIRECTORY", "/var/lib/cairn:/var/lib/other");
  EXPECT_EQ(Place(), "/var/lib/cairn") << "the first of the unit's directories, which serves one domain";
  Set("CAIRN_STATE", "/cairn");
  EXPECT_EQ(Place(), "/cairn");
  EXPECT_EQ(Place("/typed"), "/typed");
  EXPECT_EQ(Place("none"), "none");
}

TEST_F(StateDirectoryTest, AnEmptyVariableIsAsGoodAsNone) {
  Set("HOME", "/home/ann");
  for (const char* name : {"XDG_STATE_HOME", "STATE_DIRECTORY", "CAIRN_STATE"}) {
    Set(name, "");
    EXPECT_EQ(Place(), "/home/ann/.local/state/cairn/domain-7") << name;
  }
}

}  // namespace
}  // namespace cairn::server
