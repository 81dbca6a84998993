#include "common/wire/wire_arguments.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>

#include "common/wire/bus.h"

namespace cairn::wire {
namespace {

// The variable as a test wants it, and as it was afterwards.
class WireArgumentsTest : public ::testing::Test {
 protected:
  WireArgumentsTest() {
    if (const char* value = std::getenv("CAIRN_DOMAIN"); value != nullptr) before_ = value;
    unsetenv("CAIRN_DOMAIN");
  }
  ~WireArgumentsTest() override {
    unsetenv("CAIRN_DOMAIN");
    if (before_) setenv("CAIRN_DOMAIN", before_->c_str(), 1);
  }

  // The domain that comes of them, from a file that says 5; or the error.
  static Result<std::int64_t> DomainOf(const WireArguments& arguments) {
    WireOptions options;
    const VisitOptions visit = [&options](OptionVisitor& visitor) {
      visitor.Section("wire", "", [&] { Visit(visitor, options); });
    };
    if (const auto applied = ApplyYaml("wire: {domain: 5}", "c.yaml", visit); !applied)
      return tl::unexpected(applied.error());
    if (const auto applied = Apply(arguments, visit); !applied) return tl::unexpected(applied.error());
    return options.domain;
  }

 private:
  std::optional<std::string> before_;
};

TEST_F(WireArgumentsTest, TheFileGivesWayToTheMachineThatToSetAndThatToDomain) {
  EXPECT_EQ(DomainOf({}), 5);
  setenv("CAIRN_DOMAIN", "77", 1);
  EXPECT_EQ(DomainOf({}), 77);
  EXPECT_EQ(DomainOf({{"wire.domain=6"}, {}}), 6);
  EXPECT_EQ(DomainOf({{"wire.domain=6"}, 7}), 7);
  EXPECT_EQ(DomainOf({{}, 0}), 0) << "0 is a domain, too";
  setenv("CAIRN_DOMAIN", "", 1);
  EXPECT_EQ(DomainOf({}), 5);
}

TEST_F(WireArgumentsTest, AnErrorNamesWhoSaidIt) {
  const auto message = [](const WireArguments& arguments) {
    const auto domain = DomainOf(arguments);
    return domain ? std::string() : domain.error().message;
  };
  EXPECT_EQ(message({{"wire.domain=6"}, 999}), "--domain: wire.domain: '999' is out of range (allowed: 0..232)");
  EXPECT_EQ(message({{"wire.domain=-1"}, 7}), "--set: wire.domain: '-1' is out of range (allowed: 0..232)");
  setenv("CAIRN_DOMAIN", "much", 1);
  EXPECT_EQ(message({{}, 7}), "CAIRN_DOMAIN: wire.domain: 'much' is not a whole number (allowed: 0..232)");
}

}  // namespace
}  // namespace cairn::wire
