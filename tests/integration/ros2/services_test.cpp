// Services on the wire of ROS 2: a client that asks as rmw_fastrtps does gets its answer, and only its own; one of
// rmw_cyclonedds is told apart by its GUID; what is no request is counted. What throws does not end the thread of the
// bus. The client uses the generated types and Fast DDS itself, not our types for services. (A client on Cyclone DDS:
// tests/system/ros2_services_test.cpp.)
#include "common/ros2/services.h"

#include <gtest/gtest.h>

#include <atomic>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <memory>
#include <new>
#include <string>
#include <thread>
#include <vector>

#include "common/wire/ros2/participant.h"
#include "common/wire/ros2/service_endpoint.h"
#include "tests/eventually.h"
#include "tests/must.h"
#include "tests/test_domain.h"

namespace cairn::ros2 {
namespace {

using eprosima::fastrtps::types::ReturnCode_t;
using test::Eventually;
using test::Must;

WireOptions Options() {
  WireOptions options;
  options.domain = test::TestDomain();
  options.participant_lease_s = 20.0;
  return options;
}

// As rmw_fastrtps: the request is a plain sample, whose identity the answer names. A newer one names
// the reader of the answers with the request.
template <typename S>
class FastClient {
  using RequestWire = typename ServiceType<S>::RequestWire;
  using ResponseWire = typename ServiceType<S>::ResponseWire;

 public:
  FastClient(const std::string& service, bool names_its_reader) : names_its_reader_(names_its_reader) {
    participant_ = Must(Participant::Create(Options(), "client"));
    fd::DataWriterQos writer_qos;
    SetCommon({true, false, 10}, writer_qos);
    fd::DataReaderQos reader_qos;
    SetCommon({true, false, 10}, reader_qos);
    writer_ =
        participant_->publisher()->create_datawriter(Topic("rq" + service + "Request", request_type_), writer_qos);
    reader_ =
        participant_->subscriber()->create_datareader(Topic("rr" + service + "Reply", response_type_), reader_qos);
  }

  bool ServiceIsThere() const {
    fd::PublicationMatchedStatus asks;
    fd::SubscriptionMatchedStatus hears;
    writer_->get_publication_matched_status(asks);
    reader_->get_subscription_matched_status(hears);
    return asks.current_count > 0 && hears.current_count > 0;
  }
  void Ask(RequestWire request) {
    rtps::WriteParams params;
    if (names_its_reader_) params.related_sample_identity().writer_guid(reader_->guid());
    EXPECT_TRUE(writer_->write(&request, params));
    asked_ = params.sample_identity();
    if (names_its_reader_) asked_.writer_guid(reader_->guid());
  }
  // Takes what has come; true once the answer to the last request is there. Others are counted.
  bool Answered() {
    ResponseWire response;
    fd::SampleInfo info;
    while (reader_->take_next_sample(&response, &info) == ReturnCode_t::RETCODE_OK) {
      if (!info.valid_data) continue;
      if (info.related_sample_identity == asked_) {
        answer_ = response;
        ++answers_;
      } else {
        ++foreign_;
      }
    }
    return answers_ > 0;
  }
  int answers() const { return answers_; }
  int foreign() const { return foreign_; }
  const ResponseWire& answer() const { return answer_; }

 private:
  fd::Topic* Topic(const std::string& name, const fd::TypeSupport& type) {
    topics_.push_back(Must(participant_->TopicFor(name, type)));
    return topics_.back().get();
  }

  const bool names_its_reader_;
  const fd::TypeSupport request_type_{new typename ServiceType<S>::RequestType()};
  const fd::TypeSupport response_type_{new typename ServiceType<S>::ResponseType()};
  std::shared_ptr<Participant> participant_;
  std::vector<TopicUse> topics_;
  fd::DataWriter* writer_ = nullptr;
  fd::DataReader* reader_ = nullptr;
  rtps::SampleIdentity asked_;
  ResponseWire answer_;
  int answers_ = 0, foreign_ = 0;
};

class RosServices : public ::testing::Test {
 protected:
  // Serves until the thread is destroyed, which must come before what `tick` and the services refer to.
  [[nodiscard]] std::jthread Run(std::function<void()> tick = [] {}) {
    return std::jthread([this, tick = std::move(tick)](const std::stop_token& stop) {
      bus_->Run(stop, tick, std::chrono::milliseconds(10), [this](const std::exception&) { ++failures_; });
    });
  }
  // A service that answers with what `answer` makes of a request.
  template <typename S>
  std::unique_ptr<Subscription> Serve(const std::string& service,
                                      std::function<typename S::Response(const typename S::Request&)> answer) {
    const std::shared_ptr<Answers<S>> answers = Must(bus_->AdvertiseAnswers<S>(service));
    return Must(bus_->SubscribeRequests<S>(
        service, [answers, answer = std::move(answer)](typename S::Request&& request, const Caller& caller) {
          EXPECT_FALSE(caller.in_message);
          const auto response = answer(request);
          EXPECT_TRUE(Eventually([&] { return answers->Reaches(caller); }));
          EXPECT_TRUE(answers->Send(caller, response));
        }));
  }
  template <typename S>
  static void AskAndWait(FastClient<S>& client, const typename ServiceType<S>::RequestWire& request) {
    ASSERT_TRUE(Eventually([&] { return client.ServiceIsThere(); }));
    client.Ask(request);
    ASSERT_TRUE(Eventually([&] { return client.Answered(); }));
  }

  std::unique_ptr<Bus> bus_ = Must(Bus::Create(Options(), "server"));
  std::atomic<int> failures_{0};
};

TEST_F(RosServices, AMapForWhoAsksAsRmwFastrtpsDoes) {
  const auto service = Serve<GetMap>("/lab/dynamic_map", [](const GetMap::Request&) {
    GetMap::Response response;
    response.map.header.frame = "map";
    response.map.width = 400;
    response.map.height = 500;
    response.map.cells.assign(200'000, 100);  // More than one datagram.
    return response;
  });
  const std::jthread bus_thread = Run();
  for (const bool names_its_reader : {true, false}) {
    FastClient<GetMap> client("/lab/dynamic_map", names_its_reader), other("/lab/dynamic_map", names_its_reader);
    AskAndWait<GetMap>(other, {});  // Answered itself, so that the service has found its reader.
    AskAndWait<GetMap>(client, {});
    EXPECT_EQ(client.answer().map().header().frame_id(), "map");
    EXPECT_EQ(client.answer().map().info().width(), 400U);
    EXPECT_TRUE(client.answer().map().data() == std::vector<std::int8_t>(200'000, 100));
    ASSERT_TRUE(Eventually([&] {
      other.Answered();
      return other.foreign() == 1;
    }));
    EXPECT_EQ(other.answers(), 1) << "the other one is to somebody else";
  }
  EXPECT_EQ(service->refused(), 0U);
}

TEST_F(RosServices, TextsAndResults) {
  std::string name;
  const auto service = Serve<SaveMap>("/lab/save_map", [&name](const SaveMap::Request& request) {
    name = request.name;
    return SaveMap::Response{SaveMap::kNoMapReceived};
  });
  const std::jthread bus_thread = Run();
  FastClient<SaveMap> client("/lab/save_map", true);
  ::slam_toolbox::srv::dds_::SaveMap_Request_ request;
  request.name().data("monday");
  AskAndWait<SaveMap>(client, request);
  EXPECT_EQ(name, "monday");
  EXPECT_EQ(client.answer().result(), 1);
}

TEST_F(RosServices, ATextThatIsTooLongIsCountedAndNotAnswered) {
  const auto service =
      Serve<SaveMap>("/lab/save_map", [](const SaveMap::Request&) { return SaveMap::Response{SaveMap::kSuccess}; });
  const std::jthread bus_thread = Run();
  FastClient<SaveMap> client("/lab/save_map", true);
  ASSERT_TRUE(Eventually([&] { return client.ServiceIsThere(); }));
  ::slam_toolbox::srv::dds_::SaveMap_Request_ request;
  for (const std::size_t length : {std::size_t{2000}, std::size_t{100'000}}) {  // Too long a text, and too many bytes.
    request.name().data(std::string(length, 'x'));
    client.Ask(request);
  }
  EXPECT_TRUE(Eventually([&] { return service->refused() == 2; }));
  request.name().data("monday");
  AskAndWait<SaveMap>(client, request);
}

TEST_F(RosServices, WhatThrowsIsReportedAndTheBusGoesOn) {
  std::atomic<int> ticks{0}, calls{0};
  const auto service = Serve<Pause>("/lab/pause", [&calls](const Pause::Request&) {
    if (++calls == 1) throw std::bad_alloc();
    return Pause::Response{true};
  });
  const std::jthread bus_thread = Run([&ticks] {
    if (++ticks % 2 == 1) throw std::bad_alloc();
  });
  FastClient<Pause> client("/lab/pause", true);
  ASSERT_TRUE(Eventually([&] { return client.ServiceIsThere(); }));
  client.Ask({});
  ASSERT_TRUE(Eventually([&] { return calls == 1; }));
  AskAndWait<Pause>(client, {});
  EXPECT_TRUE(client.answer().status());
  EXPECT_TRUE(Eventually([&] { return ticks > 4; }));
  EXPECT_GT(failures_, 2);
}

// Request and answer of rmw_cyclonedds: a number of the client and one of the request, then the message. These bytes
// are written here by hand.
TEST(RequestsOfCyclone, HaveTheirIdentityInFrontOfTheMessage) {
  const std::vector<std::uint8_t> from_cyclone{0x01, 0x10, 5}, from_fast{0x01, 0x0f, 5};
  WriterId cyclone{}, fast{};
  std::copy(from_cyclone.begin(), from_cyclone.end(), cyclone.begin());
  std::copy(from_fast.begin(), from_fast.end(), fast.begin());
  EXPECT_TRUE(IsOfCyclone(cyclone));
  EXPECT_FALSE(IsOfCyclone(fast));

  // Big endian: client 0x0102030405060708, request 9, a string of four letters.
  std::vector<char> bytes{0, 0, 0, 0, 1, 2, 3, 4, 5, 6,   7,   8,   0,   0, 0,
                          0, 0, 0, 0, 9, 0, 0, 0, 5, 'm', 'a', 'p', 's', 0};
  Caller caller;
  caller.in_message = true;
  const auto request = DecodeRequest<SaveMap>(bytes, caller);
  ASSERT_TRUE(request) << request.error().message;
  EXPECT_EQ(request->name, "maps");
  EXPECT_EQ(caller.client, 0x0102030405060708U);
  EXPECT_EQ(caller.sequence, 9);

  AnswerType<SaveMap> type;
  AnswerSample<SaveMap> answer;
  answer.in_front = caller;
  answer.value.result(255);
  rtps::SerializedPayload_t payload(type.getSerializedSizeProvider(&answer)());
  ASSERT_TRUE(type.serialize(&answer, &payload));
  const std::vector<std::uint8_t> expected{0, 1, 0, 0, 8, 7, 6, 5, 4, 3, 2, 1, 9, 0, 0, 0, 0, 0, 0, 0, 255};
  EXPECT_EQ(std::vector<std::uint8_t>(payload.data, payload.data + payload.length), expected);
}

TEST(RequestsOfCyclone, ThatAreTooShortOrNonsenseAreRefused) {
  Caller caller;
  caller.in_message = true;
  std::vector<char> bytes{0, 1, 0, 0, 1, 2, 3, 4,      5,      6,      7,      8,  0,
                          0, 0, 0, 0, 0, 0, 9, '\xff', '\xff', '\xff', '\x7f', 'm'};
  EXPECT_FALSE(DecodeRequest<SaveMap>(bytes, caller)) << "a string of 2 GiB";
  for (std::size_t length = 0; length < 20; ++length) {
    std::vector<char> part(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(length));
    EXPECT_FALSE(DecodeRequest<GetMap>(part, caller)) << length;
    EXPECT_FALSE(DecodeRequest<Reset>(part, caller)) << length;
  }
  std::vector<char> unknown{0, 0x7f, 0, 0, 1, 2, 3, 4};
  caller.in_message = false;
  EXPECT_FALSE(DecodeRequest<Reset>(unknown, caller)) << "an encapsulation that is none";
}

}  // namespace
}  // namespace cairn::ros2
