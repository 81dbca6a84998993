#include "common/bounded_channel.h"

#include <gtest/gtest.h>

#include <future>
#include <memory>
#include <numeric>
#include <thread>
#include <vector>

namespace cairn {
namespace {

TEST(BoundedChannel, KeepsOrderAndRefusesWhenFull) {
  BoundedChannel<int> channel(2);
  EXPECT_TRUE(channel.TryPush(1));
  EXPECT_TRUE(channel.TryPush(2));
  EXPECT_FALSE(channel.TryPush(3));
  EXPECT_EQ(channel.size(), 2u);
  EXPECT_EQ(channel.capacity(), 2u);
  EXPECT_EQ(channel.Pop(), 1);
  EXPECT_TRUE(channel.TryPush(4));
  EXPECT_EQ(channel.TryPop(), 2);
  EXPECT_EQ(channel.TryPop(), 4);
  EXPECT_EQ(channel.TryPop(), std::nullopt);
}

TEST(BoundedChannel, ARefusedValueIsLeftToTheSender) {
  BoundedChannel<std::unique_ptr<int>> channel(1);
  ASSERT_TRUE(channel.TryPush(std::make_unique<int>(1)));
  auto value = std::make_unique<int>(2);
  EXPECT_FALSE(channel.TryPush(std::move(value)));
  ASSERT_NE(value, nullptr);
  EXPECT_EQ(*value, 2);
}

TEST(BoundedChannel, ClosingLetsTheRestOutAndNothingIn) {
  BoundedChannel<int> channel(4);
  ASSERT_TRUE(channel.TryPush(1));
  channel.Close();
  channel.Close();
  EXPECT_TRUE(channel.closed());
  EXPECT_FALSE(channel.TryPush(2));
  EXPECT_FALSE(channel.Push(2));
  EXPECT_EQ(channel.Pop(), 1);
  EXPECT_EQ(channel.Pop(), std::nullopt);
}

TEST(BoundedChannel, CloseWakesAWaitingReceiver) {
  BoundedChannel<int> channel(1);
  auto received = std::async(std::launch::async, [&] { return channel.Pop(); });
  channel.Close();
  EXPECT_EQ(received.get(), std::nullopt);
}

TEST(BoundedChannel, StopWakesAWaitingReceiverAndSender) {
  BoundedChannel<int> channel(1);
  std::stop_source stop;
  auto received = std::async(std::launch::async, [&] { return channel.Pop(stop.get_token()); });
  stop.request_stop();
  EXPECT_EQ(received.get(), std::nullopt);

  ASSERT_TRUE(channel.TryPush(1));
  std::stop_source stop_sender;
  auto sent = std::async(std::launch::async, [&] { return channel.Push(2, stop_sender.get_token()); });
  stop_sender.request_stop();
  EXPECT_FALSE(sent.get());
  EXPECT_EQ(channel.size(), 1u);
}

TEST(BoundedChannel, StopBeforeTheWaitIsSeen) {
  BoundedChannel<int> channel(1);
  std::stop_source stop;
  stop.request_stop();
  EXPECT_EQ(channel.Pop(stop.get_token()), std::nullopt);
}

TEST(BoundedChannel, PopForGivesUp) {
  BoundedChannel<int> channel(1);
  EXPECT_EQ(channel.PopFor(std::chrono::milliseconds(1)), std::nullopt);
  ASSERT_TRUE(channel.TryPush(7));
  EXPECT_EQ(channel.PopFor(std::chrono::milliseconds(1)), 7);
}

TEST(BoundedChannel, ManySendersAndReceiversLoseNothing) {
  constexpr int kThreads = 3, kEach = 2000;
  BoundedChannel<int> channel(8);
  std::vector<std::future<long>> receivers, senders;
  for (int i = 0; i < kThreads; ++i) {
    receivers.push_back(std::async(std::launch::async, [&] {
      long sum = 0;
      while (const auto value = channel.Pop()) sum += *value;
      return sum;
    }));
    senders.push_back(std::async(std::launch::async, [&, i] {
      long sum = 0;
      for (int k = 0; k < kEach; ++k) {
        if (channel.Push(i * kEach + k)) sum += i * kEach + k;
      }
      return sum;
    }));
  }
  long sent = 0, received = 0;
  for (auto& sender : senders) sent += sender.get();
  channel.Close();
  for (auto& receiver : receivers) received += receiver.get();
  constexpr long kCount = kThreads * kEach;
  EXPECT_EQ(sent, kCount * (kCount - 1) / 2);
  EXPECT_EQ(received, sent);
}

TEST(BoundedChannel, OneSendersValuesArriveInOrder) {
  BoundedChannel<int> channel(3);
  std::thread sender([&] {
    for (int i = 0; i < 5000; ++i) static_cast<void>(channel.Push(i));
    channel.Close();
  });
  int expected = 0;
  while (const auto value = channel.Pop()) ASSERT_EQ(*value, expected++);
  sender.join();
  EXPECT_EQ(expected, 5000);
}

}  // namespace
}  // namespace cairn
