#include "server/store/checkpoint_writer.h"

#include <algorithm>
#include <unordered_map>

#include "server/store/record_values.h"

namespace cairn::server {
namespace {

constexpr std::uint64_t kParts = 65536;  // Record numbers for the main part of each checkpoint.
constexpr std::uint64_t kFirstPiece = std::uint64_t{1} << 63;

RecordRange Range(std::uint64_t session, std::uint64_t first, std::uint64_t last) {
  return {.kind = RecordKind::kCheckpoint, .owner = session, .first = first, .last = last};
}

std::uint64_t NextNumber(const StoredPieces& stored) {
  return stored.empty() ? 0 : stored.rbegin()->first + 1;
}

}  // namespace

CheckpointWriter::CheckpointWriter(std::uint64_t session, std::uint64_t position, CheckpointContent content,
                                   StoredPieces stored)
    : session_(session), position_(position), main_(std::move(content.main)), stored_(std::move(stored)) {
  Number(std::move(content.pieces));
}

void CheckpointWriter::Number(std::vector<CheckpointPiece> pieces) {
  std::unordered_map<const void*, std::uint64_t> numbers;
  for (const auto& [number, value] : stored_)
    if (value != nullptr) numbers.emplace(value.get(), number);
  std::uint64_t next = NextNumber(stored_);
  for (CheckpointPiece& piece : pieces) {
    const auto known = numbers.find(piece.value.get());
    // A piece that the checkpoint contains twice is written twice: in a head each number stands once.
    const bool fresh = known == numbers.end() || pieces_.contains(known->second);
    const std::uint64_t number = fresh ? next++ : known->second;
    if (fresh) new_pieces_.push_back({number, std::move(piece.bytes)});
    order_.push_back(number);
    pieces_.emplace(number, std::move(piece.value));
  }
}

void CheckpointWriter::AddTo(RecordChanges& changes) {
  if (!std::exchange(begun_, true)) {
    // What a checkpoint that a crash left incomplete has written.
    changes.removed.push_back(Range(session_, position_ * kParts, kFirstPiece - 1));
    changes.removed.push_back(Range(session_, kFirstPiece + NextNumber(stored_), UINT64_MAX));
  }
  const auto key = [this](std::uint64_t number) { return RecordKey{RecordKind::kCheckpoint, session_, number}; };
  std::size_t added = 0;
  while (added < kBytesPerCommit && pieces_written_ < new_pieces_.size()) {
    NewPiece& piece = new_pieces_[pieces_written_++];
    changes.put.push_back({key(kFirstPiece + piece.number), std::exchange(piece.bytes, nullptr)()});
    added += changes.put.back().bytes.size();
  }
  while (added < kBytesPerCommit && written_ < main_.size()) {
    const std::size_t size = std::min(kPartBytes, main_.size() - written_);
    changes.put.push_back({key(position_ * kParts + ++parts_), main_.substr(written_, size)});
    written_ += size;
    added += size;
  }
  if (pieces_written_ == new_pieces_.size() && written_ == main_.size()) Complete(changes);
}

void CheckpointWriter::Complete(RecordChanges& changes) {
  record::CheckpointHead head;
  head.set_position(position_);
  head.set_parts(parts_);
  head.set_size(main_.size());
  for (const std::uint64_t number : order_) head.add_pieces(number);
  changes.put.push_back({{RecordKind::kCheckpoint, session_, position_ * kParts}, head.SerializeAsString()});
  if (position_ > 0) changes.removed.push_back(Range(session_, 0, position_ * kParts - 1));
  for (const auto& [number, value] : stored_) {
    if (!pieces_.contains(number))
      changes.removed.push_back(Range(session_, kFirstPiece + number, kFirstPiece + number));
  }
  complete_ = true;
}

std::vector<std::string_view> StoredCheckpoint::PiecesInOrder() const {
  std::vector<std::string_view> views;
  for (const std::uint64_t number : order) views.push_back(pieces.at(number));
  return views;
}

Result<std::optional<StoredCheckpoint>> ReadCheckpoint(Store& store, std::uint64_t session) {
  std::optional<StoredCheckpoint> newest;
  record::CheckpointHead head;
  std::uint32_t parts = 0;
  const auto take_head = [&](std::uint64_t position, std::string_view bytes) -> Result<void> {
    if (!head.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())) || head.position() != position)
      return Unreadable("a checkpoint");
    newest = StoredCheckpoint{position, {}, {}, {head.pieces().begin(), head.pieces().end()}};
    for (const std::uint64_t number : newest->order)
      if (!newest->pieces.emplace(number, std::string()).second) return Unreadable("a checkpoint");
    parts = 0;
    return {};
  };
  std::size_t pieces = 0;
  const auto take = [&](std::uint64_t number, std::string_view bytes) -> Result<void> {
    if (number >= kFirstPiece) {
      if (!newest) return {};
      const auto piece = newest->pieces.find(number - kFirstPiece);
      if (piece == newest->pieces.end()) return {};  // Of a checkpoint that was never completed.
      piece->second = bytes;
      ++pieces;
      return {};
    }
    const std::uint64_t position = number / kParts;
    if (number % kParts == 0) return take_head(position, bytes);
    // Parts without a head belong to a checkpoint that was never completed.
    if (!newest || newest->position != position || number % kParts > head.parts()) return {};
    if (number % kParts != ++parts) return Unreadable("a checkpoint");
    newest->bytes.append(bytes);
    return {};
  };
  auto read = store.Read({.kind = RecordKind::kCheckpoint, .owner = session}, take);
  if (!read) return tl::unexpected(read.error());
  if (newest && (parts != head.parts() || newest->bytes.size() != head.size() || pieces != newest->pieces.size()))
    return Unreadable("a checkpoint");
  return newest;
}

}  // namespace cairn::server
