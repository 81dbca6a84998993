#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "common/options/config.h"
#include "common/wire/bus.h"

namespace cairn::wire {
namespace {

TEST(WireOptions, DefaultsAreValid) {
  EXPECT_TRUE(Validate(WireOptions{}));
}

TEST(WireOptions, RefuseAnAddressThisMachineDoesNotHave) {
  WireOptions options;
  options.interfaces = {"127.0.0.1", "192.0.2.1"};  // TEST-NET-1: nobody's.
  const Result<void> result = Validate(options);
  ASSERT_FALSE(result);
  EXPECT_THAT(result.error().message, ::testing::HasSubstr("192.0.2.1"));
}

TEST(WireOptions, RefuseNoAddressAtAll) {
  WireOptions options;
  options.interfaces.clear();
  EXPECT_FALSE(Validate(options));
}

TEST(WireOptions, RefuseDomainsAndLeasesOutOfRange) {
  WireOptions options;
  options.domain = 233;
  EXPECT_FALSE(Validate(options));
  options.domain = -1;
  EXPECT_FALSE(Validate(options));
  options = {};
  options.liveliness_lease_s = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(Validate(options));
  options = {};
  options.participant_lease_s = 0.0;
  EXPECT_FALSE(Validate(options));
}

TEST(WireOptions, ABusWithInvalidOptionsIsNotMade) {
  WireOptions options;
  options.interfaces = {"not-an-address"};
  EXPECT_FALSE(Bus::Create(options, "test"));
}

TEST(WireOptions, ReadInterfacesAsOneCommaSeparatedText) {
  WireOptions options;
  const VisitOptions visit = [&](OptionVisitor& visitor) { Visit(visitor, options); };
  const Result<void> result = ApplySet({"interfaces=127.0.0.1, 10.0.0.5", "domain=7"}, visit);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_THAT(options.interfaces, ::testing::ElementsAre("127.0.0.1", "10.0.0.5"));
  EXPECT_EQ(options.domain, 7);
}

}  // namespace
}  // namespace cairn::wire
