#include "common/wire/client_filter.h"

#include <gtest/gtest.h>

#include <fastdds/dds/core/LoanableSequence.hpp>
#include <fastdds/dds/topic/IContentFilter.hpp>
#include <limits>

#include "common/wire/sample_type.h"

namespace cairn::wire {
namespace {

namespace fd = eprosima::fastdds::dds;
using eprosima::fastrtps::types::ReturnCode_t;

TEST(ClientFilter, TheExpressionIsTheClient) {
  for (const ClientId client : {ClientId{0}, ClientId{7}, std::numeric_limits<ClientId>::max()})
    EXPECT_EQ(ClientOfExpression(ClientExpression(client)), client);
}

TEST(ClientFilter, NothingElseIsAnExpression) {
  for (const char* text : {"", " 1", "1 ", "-1", "+1", "1.0", "0x1", "client = 1", "18446744073709551616", "1;2"})
    EXPECT_EQ(ClientOfExpression(text), std::nullopt) << text;
}

class FactoryTest : public ::testing::Test {
 protected:
  ~FactoryTest() override { ClientFilters().delete_content_filter(kClientFilterClass, filter_); }
  ReturnCode_t Create(const char* expression) {
    return ClientFilters().create_content_filter(kClientFilterClass, "type", nullptr, expression,
                                                 fd::LoanableSequence<const char*>(), filter_);
  }
  // Whether a reply to this client passes.
  [[nodiscard]] bool Passes(std::uint8_t client, std::uint32_t length = 12) const {
    eprosima::fastrtps::rtps::SerializedPayload_t payload(12);
    payload.length = length;
    for (std::uint32_t i = 0; i < 12; ++i) payload.data[i] = 0;
    payload.data[1] = 1;  // Little endian.
    payload.data[4] = client;
    return filter_->evaluate(payload, {}, {});
  }
  fd::IContentFilter* filter_ = nullptr;
};

TEST_F(FactoryTest, LetsTheRepliesOfOneClientThrough) {
  ASSERT_EQ(Create("5"), ReturnCode_t::RETCODE_OK);
  EXPECT_TRUE(Passes(5));
  EXPECT_FALSE(Passes(6));
}

TEST_F(FactoryTest, LetsThroughWhatItCanNotRead) {
  ASSERT_EQ(Create("5"), ReturnCode_t::RETCODE_OK);
  EXPECT_TRUE(Passes(6, 11));
}

TEST_F(FactoryTest, AnExpressionThatIsNoneLeavesTheFilterAsItWas) {
  EXPECT_EQ(Create("x"), ReturnCode_t::RETCODE_BAD_PARAMETER);
  EXPECT_EQ(Create(nullptr), ReturnCode_t::RETCODE_BAD_PARAMETER);
  EXPECT_EQ(filter_, nullptr);
  ASSERT_EQ(Create("5"), ReturnCode_t::RETCODE_OK);
  EXPECT_EQ(Create("x"), ReturnCode_t::RETCODE_BAD_PARAMETER);
  EXPECT_EQ(Create(nullptr), ReturnCode_t::RETCODE_OK);
  EXPECT_TRUE(Passes(5));
  EXPECT_FALSE(Passes(6));
  ASSERT_EQ(Create("6"), ReturnCode_t::RETCODE_OK);
  EXPECT_TRUE(Passes(6));
}

}  // namespace
}  // namespace cairn::wire
