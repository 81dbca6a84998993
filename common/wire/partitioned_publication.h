// What a server writes with where a topic has several writers, each in partitions of its own: replies, and what is
// written about single robots. Thread-safe.
#pragma once

#include <algorithm>
#include <chrono>
#include <memory>
#include <type_traits>
#include <vector>

#include "common/wire/partitions.h"
#include "common/wire/publication.h"

namespace cairn::wire {

template <typename Value>
class PartitionedPublication final : public Publication<Value> {
 public:
  [[nodiscard]] static Result<std::unique_ptr<Publication<Value>>> Make(
      const std::shared_ptr<Participant>& participant) {
    auto made = std::make_unique<PartitionedPublication>();
    for (const auto& names : PartitionsOfWriters(Topic<Value>::kProfile.partitions, participant->has_shares())) {
      auto part = DdsPublication<Value>::Make(participant, names);
      if (!part) return tl::unexpected(part.error());
      made->parts_.push_back(std::move(*part));
    }
    return made;
  }

  Result<void> Publish(const Value& value) override { return PartOf(value).Publish(value); }
  Result<void> Retire(const Value& value) override { return PartOf(value).Retire(value); }

  bool WaitForAcknowledgement(std::chrono::milliseconds deadline) override {
    const auto until = std::chrono::steady_clock::now() + deadline;
    return std::all_of(parts_.begin(), parts_.end(), [&](const auto& part) {
      const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(until - std::chrono::steady_clock::now());
      return part->WaitForAcknowledgement(std::max(left, std::chrono::milliseconds(0)));
    });
  }

  // A reader that reads all partitions counts in each.
  int matched() const override {
    int all = 0;
    for (const auto& part : parts_) all += part->matched();
    return all;
  }

 private:
  Publication<Value>& PartOf(const Value& value) {
    if constexpr (std::is_same_v<Value, Reply>) {
      return *parts_[ReplyPartitionOf(value.client)];
    } else {
      return *parts_[ShareOf(value.robot_id) % parts_.size()];
    }
  }

  std::vector<std::unique_ptr<Publication<Value>>> parts_;
};

}  // namespace cairn::wire
