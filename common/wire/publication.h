// A typed writer of one topic. Thread-safe.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "common/wire/bounds.h"
#include "common/wire/convert.h"
#include "common/wire/limits.h"
#include "common/wire/participant.h"

namespace cairn::wire {

template <typename Value>
class DdsPublication final : public Publication<Value>, private fd::DataWriterListener {
  using Wire = typename Topic<Value>::Wire;

 public:
  [[nodiscard]] static Result<std::unique_ptr<Publication<Value>>> Make(const std::shared_ptr<Participant>& participant,
                                                                        const std::vector<std::string>& partitions) {
    auto made = std::make_unique<DdsPublication>();
    Result<Participant::Writer> writer =
        participant->MakeWriter(Topic<Value>::kProfile, made->type_, made.get(), partitions);
    if (!writer) return tl::unexpected(writer.error());
    made->participant_ = participant;
    made->partitions_ = partitions;
    made->writer_ = std::move(*writer);
    return made;
  }

  Result<void> Publish(const Value& value) override {
    if constexpr (std::is_same_v<Value, TileSample>) {
      if (!FitsTileKey(value.tile.key)) return Fail(StatusCode::kOutOfRange, "tile: coordinates beyond 16 bits");
    }
    Sample<Wire> sample;
    sample.value = ToWire(value);
    if (Result<void> bounds = CheckBounds(sample.value); !bounds) return bounds;
    const std::size_t bytes = Wire::getCdrSerializedSize(sample.value);
    if (bytes > kMaxSampleBytes) {
      return Fail(StatusCode::kOutOfRange, std::string(Topic<Value>::kProfile.name) + ": " + std::to_string(bytes) +
                                               " bytes, at most " + std::to_string(kMaxSampleBytes));
    }
    const MutexLock lock(mutex_);
    if (!Write(sample)) {
      return Fail(StatusCode::kUnavailable,
                  std::string(Topic<Value>::kProfile.name) + ": the writer's history is full");
    }
    return {};
  }

  Result<void> Retire(const Value& value) override {
    Sample<Wire> sample;
    sample.value = ToWire(value);
    const MutexLock lock(mutex_);
    if (live_.erase(KeyOf(sample)) > 0) return {};
    return Fail(StatusCode::kNotFound, std::string(Topic<Value>::kProfile.name) + ": no such key");
  }

  bool WaitForAcknowledgement(std::chrono::milliseconds deadline) override {
    const MutexLock lock(mutex_);
    return writer_->wait_for_acknowledgments(eprosima::fastrtps::Duration_t(deadline.count() * 1e-3L)) ==
           eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK;
  }

  int matched() const override { return matched_.load(); }

 private:
  using Key = std::array<std::uint8_t, 16>;
  // The topics of the server whose keys change while it runs: sessions, jobs, sites and tiles begin and end.
  static constexpr bool kRetires = std::is_same_v<Value, SessionState> || std::is_same_v<Value, PoseReport> ||
                                   std::is_same_v<Value, Ledger> || std::is_same_v<Value, Job> ||
                                   std::is_same_v<Value, MapInfo> || std::is_same_v<Value, TileSample>;

  Key KeyOf(Sample<Wire>& sample) {
    fd::InstanceHandle_t handle;
    Key key{};
    if (kRetires && type_.get_key(&sample, &handle))
      std::copy_n(static_cast<const std::uint8_t*>(handle.value), 16, key.begin());
    return key;
  }

  bool Write(Sample<Wire>& sample) CAIRN_REQUIRES(mutex_) {
    if constexpr (!kRetires) {
      return writer_->write(&sample);
    } else {
      const Key key = KeyOf(sample);
      const auto places = static_cast<std::size_t>(Topic<Value>::kProfile.max_instances);
      if (used_.size() >= places && !used_.contains(key)) {
        ForgetDeleted();
        // The samples of keys that are new wait until the writer has room.
        if (live_.size() >= used_.size() || !Renew()) return false;
      } else if (written_ >= MostWritten()) {
        static_cast<void>(Renew());  // Until it can, the old one goes on.
      }
      if (!writer_->write(&sample)) return false;
      ++written_;
      used_.insert(key);
      live_.insert_or_assign(key, sample);
      if constexpr (std::is_same_v<Value, TileSample>) deleted_ += sample.value.deleted() ? 1 : 0;
      return true;
    }
  }

  // The new writer sends what is kept to every reader again, so it must be little beside what the old one has sent.
  [[nodiscard]] std::uint64_t MostWritten() const CAIRN_REQUIRES(mutex_) {
    constexpr std::uint64_t kMostAgain = 10;  // One of so many samples is one that is sent again.
    return std::max<std::uint64_t>(participant_->options().most_written, kMostAgain * live_.size());
  }

  // A deleted tile is told to the readers that know the tile. When all of them have been told, it needs no place any
  // more, unless it is the newest change of its site: whoever comes late waits for that (TileMirror::complete).
  void ForgetDeleted() CAIRN_REQUIRES(mutex_) {
    if constexpr (std::is_same_v<Value, TileSample>) {
      if (deleted_ == 0) return;
      if (writer_->wait_for_acknowledgments({0, 1}) != eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK) return;
      deleted_ = 0;
      std::map<NameId, const Wire*> newest;
      for (const auto& [key, sample] : live_) {
        const Wire*& known = newest[sample.value.site_id()];
        const auto rank = [](const Wire& tile) { return std::pair(tile.content().version(), !tile.deleted()); };
        if (known == nullptr || rank(*known) < rank(sample.value)) known = &sample.value;
      }
      std::erase_if(live_, [&](const auto& one) {
        const Wire& tile = one.second.value;
        return tile.deleted() && newest.at(tile.site_id()) != &tile;
      });
    }
  }

  // The place of a key in a writer cannot be freed, because unregistering a key stops the data to the readers
  // (idl/README.md), and the numbers of a writer only grow. So a new writer, which has only the keys that still exist,
  // replaces the old one as soon as it has matched the same readers. Before that, samples of topics without history
  // would be lost. Returns false if it has not matched them yet.
  bool Renew() CAIRN_REQUIRES(mutex_) {
    constexpr std::chrono::seconds kLongestSearch{2};  // A reader on a host that was lost never matches the new writer.
    const auto now = std::chrono::steady_clock::now();
    if (!successor_) {
      Result<Participant::Writer> writer = participant_->MakeWriter(Topic<Value>::kProfile, type_, this, partitions_);
      if (!writer) return false;
      successor_ = std::move(*writer);
      successor_made_ = now;
    }
    if (ReadersOf(*successor_) < ReadersOf(*writer_) && now - successor_made_ < kLongestSearch) return false;
    constexpr long double kPatienceS = 0.1L;
    static_cast<void>(writer_->wait_for_acknowledgments(eprosima::fastrtps::Duration_t(kPatienceS)));
    ForgetDeleted();
    used_.clear();
    // Late joiners get the last sample of each key from the writer that knows it.
    for (auto& [key, sample] : live_) {
      if (Topic<Value>::kProfile.transient_local && successor_->write(&sample)) used_.insert(key);
    }
    written_ = used_.size();
    writer_ = std::move(successor_);
    matched_.store(ReadersOf(*writer_));
    return true;
  }

  static int ReadersOf(fd::DataWriter& writer) {
    fd::PublicationMatchedStatus status;
    static_cast<void>(writer.get_publication_matched_status(status));
    return status.current_count;
  }

  void on_publication_matched(fd::DataWriter*, const fd::PublicationMatchedStatus& status) override {
    matched_.store(status.current_count);
  }

  std::atomic<int> matched_ = 0;
  std::shared_ptr<Participant> participant_;
  std::vector<std::string> partitions_;
  fd::TypeSupport type_{new typename Topic<Value>::Type()};
  Mutex mutex_;
  std::map<Key, Sample<Wire>> live_ CAIRN_GUARDED_BY(mutex_);  // Where keys are retired: the last sample of each.
  std::set<Key> used_ CAIRN_GUARDED_BY(mutex_);                // Keys that have a place in the writer.
  std::uint64_t written_ CAIRN_GUARDED_BY(mutex_) = 0;         // Samples, by the present writer.
  std::uint64_t deleted_ CAIRN_GUARDED_BY(mutex_) = 0;         // Of tiles: deletions since ForgetDeleted.
  // The last members: they call the listener until they are destroyed.
  Participant::Writer writer_;
  Participant::Writer successor_
      CAIRN_GUARDED_BY(mutex_);  // From the first sample without a place until it takes over.
  std::chrono::steady_clock::time_point successor_made_ CAIRN_GUARDED_BY(mutex_);
};

}  // namespace cairn::wire
