#include "common/wire/peer_watch.h"

#include <fastdds/rtps/writer/WriterDiscoveryInfo.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn::wire {
namespace {

namespace rtps = eprosima::fastrtps::rtps;
using Info = rtps::WriterDiscoveryInfo;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class Watched : public ::testing::Test {
 protected:
  Watched() { std::istringstream("01.0f.10.20.30.40.50.60.70.80.90.a0|0.0.1.3") >> writer_; }
  void Announce(const std::vector<std::string>& partitions, Info::DISCOVERY_STATUS status = Info::DISCOVERED_WRITER) {
    rtps::WriterProxyData data(1, 1);
    data.guid(writer_);
    for (const std::string& partition : partitions) data.m_qos.m_partition.push_back(partition.c_str());
    Info info(data);
    info.status = status;
    static_cast<eprosima::fastdds::dds::DomainParticipantListener&>(watch_).on_publisher_discovery(nullptr,
                                                                                                   std::move(info));
  }
  bool SpeaksFor(const char* robot) { return watch_.MaySpeakFor(writer_, HashName(robot)); }

  PeerWatch watch_{true};
  PeerWatch::Guid writer_;
};

TEST_F(Watched, WritersSpeakForTheRobotOfTheirPartition) {
  EXPECT_FALSE(SpeaksFor("r1")) << "not announced yet";
  Announce({"r1"});
  EXPECT_TRUE(SpeaksFor("r1"));
  EXPECT_FALSE(SpeaksFor("r2"));
  EXPECT_EQ(watch_.refusals().samples, 2u);
  EXPECT_EQ(watch_.TakeLines().size(), 1u) << "said once for each writer";
}

TEST_F(Watched, WritersWithoutOnePartitionSpeakForNobody) {
  Announce({});
  EXPECT_FALSE(SpeaksFor("r1"));
  EXPECT_FALSE(SpeaksFor(""));
  writer_.entityId.value[2] = 9;
  Announce({"r1", "r2"});
  EXPECT_FALSE(SpeaksFor("r1"));
  EXPECT_FALSE(SpeaksFor("r2"));
}

// The access control has seen only one of them: perhaps the other.
TEST_F(Watched, WritersThatChangeTheirPartitionSpeakForNobody) {
  Announce({"r2"});
  Announce({"r1"}, Info::CHANGED_QOS_WRITER);
  EXPECT_FALSE(SpeaksFor("r1"));
  EXPECT_FALSE(SpeaksFor("r2"));
  Announce({"r2"}, Info::CHANGED_QOS_WRITER);
  EXPECT_FALSE(SpeaksFor("r2"));
}

TEST_F(Watched, WritersThatComeBackWithAnotherPartitionSpeakForNobody) {
  Announce({"r2"});
  Announce({"r2"}, Info::REMOVED_WRITER);
  EXPECT_TRUE(SpeaksFor("r2")) << "what was sent before still counts";
  Announce({"r1"});
  EXPECT_FALSE(SpeaksFor("r1"));
}

TEST_F(Watched, TheLogOfTheLibraryNamesRefusedEndpointsAndPeers) {
  watch_.OnLibraryError(
      "Error checking create remote writer 01.0f.10.20.30.40.50.60.70.80.90.a0|0.0.1.3 (x topic not found in allow "
      "rule.)");
  watch_.OnLibraryError("Error validating remote permissions for 01.0f.10.20.30.40.50.60.70.80.90.a0|0.0.1.c1 (why).");
  watch_.OnLibraryError("Error of another kind (01.0f)");
  EXPECT_EQ(watch_.refusals(), (Refusals{.secure = true, .peers = 1, .endpoints = 1}));
  EXPECT_THAT(watch_.TakeLines(),
              ElementsAre(HasSubstr("90.a0 is refused: x topic not found in allow rule."),
                          HasSubstr("peer 01.0f.10.20.30.40.50.60.70.80.90.a0 at an unknown address is refused: why")));
  EXPECT_THAT(watch_.TakeLines(), IsEmpty());
}

TEST_F(Watched, StrangersDoNotFillTheLog) {
  for (int i = 0; i < 1000; ++i) {
    watch_.OnLibraryError("Error validating remote permissions for 01.0f.10.20.30.40.50.60.70.80." +
                          std::to_string(10 + i / 50) + "." + std::to_string(10 + i % 50) + "|0.0.1.c1 (why).");
  }
  EXPECT_EQ(watch_.refusals().peers, 1000u);
  EXPECT_LE(watch_.TakeLines().size(), 33u);
}

TEST(UnsecuredWatch, LetsEverybodySpeak) {
  PeerWatch watch(false);
  EXPECT_TRUE(watch.MaySpeakFor({}, HashName("r1")));
  EXPECT_EQ(watch.refusals(), Refusals{});
}

}  // namespace
}  // namespace cairn::wire
