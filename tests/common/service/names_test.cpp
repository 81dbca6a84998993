#include "common/service/names.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn {
namespace {

TEST(HashName, IsFnv1aForEver) {
  // Published test vectors of FNV-1a, 64 bits.
  EXPECT_EQ(HashName(""), 0xcbf29ce484222325ULL);
  EXPECT_EQ(HashName("a"), 0xaf63dc4c8601ec8cULL);
  EXPECT_EQ(HashName("foobar"), 0x85944171f73967e8ULL);
}

TEST(ValidateName, AcceptsOrdinaryNames) {
  for (const char* name : {"r", "robot-7", "floor_2.east", "7", "_x", "A.B-C_D"}) {
    EXPECT_TRUE(ValidateName("robot", name)) << name;
  }
  EXPECT_TRUE(ValidateName("robot", std::string(64, 'x')));
}

TEST(ValidateName, RefusesOthersAndSaysWhy) {
  for (const char* name : {"", ".hidden", "-option", "a b", "a/b", "..", "grün", "a\n", "a\"b"}) {
    const auto result = ValidateName("robot", name);
    ASSERT_FALSE(result) << name;
    EXPECT_EQ(result.error().code, StatusCode::kInvalidArgument);
    EXPECT_THAT(result.error().message, testing::StartsWith("robot name '"));
  }
  EXPECT_FALSE(ValidateName("site", std::string(65, 'x')));
  EXPECT_FALSE(ValidateName("site", std::string_view("a\0b", 3)));
}

}  // namespace
}  // namespace cairn
