#include "server/tools/log_run/json_line.h"

#include <gtest/gtest.h>

#include <limits>

namespace cairn::server {
namespace {

TEST(JsonLine, KeepsTheOrderAndWritesNumbersThatAreNoneAsNull) {
  EXPECT_EQ(JsonLine({{"b", 0.1}, {"a", std::numeric_limits<double>::quiet_NaN()}}), "{\"b\":0.1,\"a\":null}\n");
}

// The name of a file is in the message of its error, and it may be any bytes.
TEST(JsonLine, AnErrorWithBytesThatAreNoTextIsStillJson) {
  const std::string line = ErrorJson({StatusCode::kNotFound, "no file '\xff\"\n'"});
  const Json object = Json::parse(line);
  EXPECT_EQ(object["error"]["code"], "NOT_FOUND");
  EXPECT_EQ(line.find('\n'), line.size() - 1);
}

}  // namespace
}  // namespace cairn::server
