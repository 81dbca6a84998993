#include "server/store/checkpoint_writer.h"

#include <algorithm>
#include <string_view>

#include "server/store/record_values.h"

namespace cairn::server {
namespace {

constexpr std::uint64_t kParts = 65536;  // Record numbers for each checkpoint.

}  // namespace

RecordKey CheckpointWriter::KeyOf(std::uint32_t part) const {
  return {RecordKind::kCheckpoint, session_, position_ * kParts + part};
}

void CheckpointWriter::AddTo(RecordChanges& changes) {
  if (parts_ == 0) {
    // Parts of a checkpoint that a crash left incomplete.
    changes.removed.push_back(
        {.kind = RecordKind::kCheckpoint, .owner = session_, .first = position_ * kParts, .last = UINT64_MAX});
  }
  for (std::size_t i = 0; i < kPartsPerCommit && written_ < bytes_.size(); ++i) {
    const std::size_t size = std::min(kPartBytes, bytes_.size() - written_);
    changes.put.push_back({KeyOf(++parts_), bytes_.substr(written_, size)});
    written_ += size;
  }
  if (written_ < bytes_.size()) return;
  record::CheckpointHead head;
  head.set_position(position_);
  head.set_parts(parts_);
  head.set_size(bytes_.size());
  changes.put.push_back({KeyOf(0), head.SerializeAsString()});
  if (position_ > 0) {
    changes.removed.push_back(
        {.kind = RecordKind::kCheckpoint, .owner = session_, .first = 0, .last = position_ * kParts - 1});
  }
  complete_ = true;
}

Result<std::optional<StoredCheckpoint>> ReadCheckpoint(Store& store, std::uint64_t session) {
  std::optional<StoredCheckpoint> newest;
  record::CheckpointHead head;
  std::uint32_t parts = 0;
  const auto take = [&](std::uint64_t number, std::string_view bytes) -> Result<void> {
    const std::uint64_t position = number / kParts;
    if (number % kParts == 0) {
      if (!head.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())) || head.position() != position)
        return Unreadable("a checkpoint");
      newest = StoredCheckpoint{position, {}};
      parts = 0;
      return {};
    }
    // Parts without a head belong to a checkpoint that was never completed.
    if (!newest || newest->position != position || number % kParts > head.parts()) return {};
    if (number % kParts != ++parts) return Unreadable("a checkpoint");
    newest->bytes.append(bytes);
    return {};
  };
  auto read = store.Read({.kind = RecordKind::kCheckpoint, .owner = session}, take);
  if (!read) return tl::unexpected(read.error());
  if (newest && (parts != head.parts() || newest->bytes.size() != head.size())) return Unreadable("a checkpoint");
  return newest;
}

}  // namespace cairn::server
