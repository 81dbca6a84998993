// What a server writes replies with: a writer in each partition of replies. Thread-safe.
#pragma once

#include <algorithm>
#include <chrono>
#include <memory>
#include <vector>

#include "common/wire/partitions.h"
#include "common/wire/publication.h"

namespace cairn::wire {

class ReplyPublication final : public Publication<Reply> {
 public:
  [[nodiscard]] static Result<std::unique_ptr<Publication<Reply>>> Make(
      const std::shared_ptr<Participant>& participant) {
    auto made = std::make_unique<ReplyPublication>();
    for (std::uint64_t partition = 0; partition < kReplyPartitions; ++partition) {
      auto part = DdsPublication<Reply>::Make(participant, ReplyPartition(partition));
      if (!part) return tl::unexpected(part.error());
      made->parts_.push_back(std::move(*part));
    }
    return made;
  }

  Result<void> Publish(const Reply& reply) override { return parts_[ReplyPartitionOf(reply.client)]->Publish(reply); }
  Result<void> Retire(const Reply& reply) override { return parts_[ReplyPartitionOf(reply.client)]->Retire(reply); }

  bool WaitForAcknowledgement(std::chrono::milliseconds deadline) override {
    const auto until = std::chrono::steady_clock::now() + deadline;
    return std::all_of(parts_.begin(), parts_.end(), [&](const auto& part) {
      const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(until - std::chrono::steady_clock::now());
      return part->WaitForAcknowledgement(std::max(left, std::chrono::milliseconds(0)));
    });
  }

  // A reader in every partition counts in each.
  int matched() const override {
    int all = 0;
    for (const auto& part : parts_) all += part->matched();
    return all;
  }

 private:
  std::vector<std::unique_ptr<Publication<Reply>>> parts_;
};

}  // namespace cairn::wire
