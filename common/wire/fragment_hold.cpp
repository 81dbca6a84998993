#include "common/wire/fragment_hold.h"

#include <algorithm>

namespace cairn::wire {
namespace {

constexpr std::size_t kSampleBytes = 512;  // About what a sample takes beside its datagrams.

}  // namespace

std::vector<FragmentHold::Datagram> FragmentHold::Add(std::span<const std::uint8_t> datagram,
                                                      std::span<const FragmentRange> fragments) {
  const auto held = std::make_shared<Held>(Held{{datagram.begin(), datagram.end()}, ++counter_, 0});
  std::vector<FragmentRange::Key> complete;
  for (const FragmentRange& range : fragments) {
    Sample& sample = SampleOf(range)->second;
    for (std::size_t i = range.first - 1; i < range.first - 1 + range.count; ++i) {
      if (!sample.arrived[i]) --sample.missing;
      sample.arrived[i] = true;
    }
    if (sample.datagrams.empty() || sample.datagrams.back() != held) {
      sample.datagrams.push_back(held);
      sample.bytes += datagram.size();
      bytes_ += datagram.size();
      ++held->waits_for;
    }
    if (sample.missing == 0) complete.push_back(range.sample);
    MakeRoom();
  }
  std::vector<std::shared_ptr<Held>> free;
  for (const FragmentRange::Key& key : complete) {
    const auto sample = samples_.find(key);  // It may be gone, or be another one, if the datagram contradicts itself.
    if (sample == samples_.end() || sample->second.missing > 0) continue;
    for (const auto& one : sample->second.datagrams)
      if (--one->waits_for == 0) free.push_back(one);
    Forget(sample);
  }
  std::ranges::sort(free, {}, [](const auto& one) { return one->number; });
  std::vector<Datagram> now;
  for (const auto& one : free) now.push_back(std::move(one->bytes));
  return now;
}

// Fragments of another size belong to another sample: what came before can not become whole with them.
FragmentHold::Samples::iterator FragmentHold::SampleOf(const FragmentRange& range) {
  auto at = samples_.find(range.sample);
  if (at != samples_.end() &&
      (at->second.fragment_bytes != range.fragment_bytes || at->second.sample_bytes != range.sample_bytes)) {
    Forget(at);
    at = samples_.end();
  }
  if (at != samples_.end()) return at;
  at = samples_.emplace(range.sample, Sample{}).first;
  Sample& sample = at->second;
  sample.fragment_bytes = range.fragment_bytes;
  sample.sample_bytes = range.sample_bytes;
  sample.missing = (range.sample_bytes + range.fragment_bytes - 1) / range.fragment_bytes;
  sample.arrived.resize(sample.missing);
  sample.begun = ++counter_;
  sample.bytes = kSampleBytes + sample.missing / 8;
  bytes_ += sample.bytes;
  begun_.emplace_back(sample.begun, range.sample);
  return at;
}

void FragmentHold::Forget(Samples::iterator sample) {
  bytes_ -= sample->second.bytes;
  samples_.erase(sample);
}

void FragmentHold::MakeRoom() {
  while (!begun_.empty()) {
    const auto oldest = samples_.find(begun_.front().second);
    const bool there = oldest != samples_.end() && oldest->second.begun == begun_.front().first;
    if (there && bytes_ <= kMaxBytes) return;
    if (there) Forget(oldest);
    begun_.pop_front();
  }
}

}  // namespace cairn::wire
