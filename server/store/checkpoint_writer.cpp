#include "server/store/checkpoint_writer.h"

#include <algorithm>
#include <stdexcept>
#include <unordered_map>

#include "server/store/record_values.h"

namespace cairn::server {
namespace {

constexpr std::uint64_t kParts = 65536;  // Record numbers for the main part of each checkpoint.
constexpr std::uint64_t kFirstPiece = std::uint64_t{1} << 63;
constexpr std::uint64_t kFirstRest =
    kFirstPiece + (std::uint64_t{1} << 62);  // All parts of the pieces but their first ones.
constexpr std::uint64_t kMostPieces = std::uint64_t{1} << 46;

RecordRange Range(std::uint64_t session, std::uint64_t first, std::uint64_t last) {
  return {.kind = RecordKind::kCheckpoint, .owner = session, .first = first, .last = last};
}

// Numbers of the parts of a piece that follow its first one.
RecordRange RestOf(std::uint64_t session, std::uint64_t piece) {
  return Range(session, kFirstRest + piece * kParts, kFirstRest + (piece + 1) * kParts - 1);
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
  for (const auto& [number, piece] : stored_)
    if (piece.value != nullptr) numbers.emplace(piece.value.get(), number);
  std::uint64_t next = NextNumber(stored_);
  for (CheckpointPiece& piece : pieces) {
    const auto known = numbers.find(piece.value.get());
    // A piece that the checkpoint contains twice is written twice: in a head each number stands once.
    const bool fresh = known == numbers.end() || pieces_.contains(known->second);
    const std::uint64_t number = fresh ? next++ : known->second;
    if (fresh) new_pieces_.push_back({number, std::move(piece.bytes)});
    order_.push_back(number);
    pieces_.emplace(number, StoredPiece{std::move(piece.value), fresh ? 1 : stored_.at(number).parts});
  }
}

void CheckpointWriter::AddTo(RecordChanges& changes) {
  if (!std::exchange(begun_, true)) {
    // What a checkpoint that a crash left incomplete has written.
    const std::uint64_t next = NextNumber(stored_);
    changes.removed.push_back(Range(session_, position_ * kParts, kFirstPiece - 1));
    changes.removed.push_back(Range(session_, kFirstPiece + next, kFirstRest - 1));
    changes.removed.push_back(Range(session_, kFirstRest + next * kParts, UINT64_MAX));
  }
  std::size_t added = 0;
  while (added < kBytesPerCommit && pieces_written_ < new_pieces_.size()) added += AddPiecePart(changes);
  while (added < kBytesPerCommit && written_ < main_.size()) added += AddMainPart(changes);
  if (pieces_written_ == new_pieces_.size() && written_ == main_.size()) Complete(changes);
}

// The next part of the piece that is being written, or the first one of the next piece. Returns its bytes, and at least
// 1, so that many empty pieces take several commits, too.
std::size_t CheckpointWriter::AddPiecePart(RecordChanges& changes) {
  NewPiece& piece = new_pieces_[pieces_written_];
  if (piece_parts_ == 0) piece_ = std::exchange(piece.bytes, nullptr)();
  if (piece_parts_ == kParts || piece.number >= kMostPieces)
    throw std::length_error("a piece of the checkpoint has " + std::to_string(piece_.size()) + " bytes, too many");
  const std::size_t size = std::min(kPartBytes, piece_.size() - piece_written_);
  const std::uint64_t number =
      piece_parts_ == 0 ? kFirstPiece + piece.number : kFirstRest + piece.number * kParts + piece_parts_;
  changes.put.push_back({{RecordKind::kCheckpoint, session_, number}, piece_.substr(piece_written_, size)});
  piece_written_ += size;
  pieces_[piece.number].parts = ++piece_parts_;
  if (piece_written_ == piece_.size()) {
    ++pieces_written_;
    std::string().swap(piece_);
    piece_written_ = 0;
    piece_parts_ = 0;
  }
  return std::max<std::size_t>(size, 1);
}

std::size_t CheckpointWriter::AddMainPart(RecordChanges& changes) {
  if (parts_ + 1 == kParts)
    throw std::length_error("the main part of the checkpoint has " + std::to_string(main_.size()) + " bytes, too many");
  const std::size_t size = std::min(kPartBytes, main_.size() - written_);
  changes.put.push_back(
      {{RecordKind::kCheckpoint, session_, position_ * kParts + ++parts_}, main_.substr(written_, size)});
  written_ += size;
  return size;
}

void CheckpointWriter::Remove(std::uint64_t piece, std::uint32_t parts, RecordChanges& changes) const {
  changes.removed.push_back(Range(session_, kFirstPiece + piece, kFirstPiece + piece));
  if (parts > 1) changes.removed.push_back(RestOf(session_, piece));
}

void CheckpointWriter::Complete(RecordChanges& changes) {
  record::CheckpointHead head;
  head.set_position(position_);
  head.set_parts(parts_);
  head.set_size(main_.size());
  for (const std::uint64_t number : order_) {
    head.add_pieces(number);
    if (pieces_.at(number).parts == 1) continue;
    record::CheckpointHead::LargePiece& large = *head.add_large();
    large.set_number(number);
    large.set_parts(pieces_.at(number).parts);
  }
  changes.put.push_back({{RecordKind::kCheckpoint, session_, position_ * kParts}, head.SerializeAsString()});
  if (position_ > 0) changes.removed.push_back(Range(session_, 0, position_ * kParts - 1));
  for (const auto& [number, piece] : stored_)
    if (!pieces_.contains(number)) Remove(number, piece.parts, changes);
  complete_ = true;
}

std::vector<std::string_view> StoredCheckpoint::PiecesInOrder() const {
  std::vector<std::string_view> views;
  for (const std::uint64_t number : order) views.push_back(pieces.at(number));
  return views;
}

namespace {

// Puts a checkpoint together from its records, which come in the order of their numbers.
class CheckpointReader {
 public:
  Result<void> Take(std::uint64_t number, std::string&& bytes) {
    if (number >= kFirstRest)
      return TakePiece((number - kFirstRest) / kParts, (number - kFirstRest) % kParts, std::move(bytes));
    if (number >= kFirstPiece) return TakePiece(number - kFirstPiece, 0, std::move(bytes));
    if (number % kParts == 0) return TakeHead(number / kParts, bytes);
    return TakeMain(number / kParts, number % kParts, bytes);
  }
  Result<std::optional<StoredCheckpoint>> Finish() && {
    if (!newest_) return std::nullopt;
    if (parts_ != head_.parts() || newest_->bytes.size() != head_.size() || read_ != newest_->parts)
      return Unreadable("a checkpoint");
    return std::move(newest_);
  }

 private:
  Result<void> TakeHead(std::uint64_t position, std::string_view bytes) {
    if (!head_.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())) || head_.position() != position)
      return Unreadable("a checkpoint");
    newest_ = StoredCheckpoint{position, {}, {}, {head_.pieces().begin(), head_.pieces().end()}, {}};
    for (const std::uint64_t number : newest_->order)
      if (!newest_->parts.emplace(number, 1).second) return Unreadable("a checkpoint");
    for (const auto& large : head_.large()) {
      const auto piece = newest_->parts.find(large.number());
      if (piece == newest_->parts.end() || large.parts() < 2 || large.parts() > kParts)
        return Unreadable("a checkpoint");
      piece->second = large.parts();
    }
    parts_ = 0;
    return {};
  }
  // Parts without a head belong to a checkpoint that was never completed.
  Result<void> TakeMain(std::uint64_t position, std::uint64_t part, std::string_view bytes) {
    if (!newest_ || newest_->position != position || part > head_.parts()) return {};
    if (part != ++parts_) return Unreadable("a checkpoint");
    newest_->bytes.append(bytes);
    return {};
  }
  Result<void> TakePiece(std::uint64_t number, std::uint64_t part, std::string&& bytes) {
    if (!newest_) return {};
    const auto piece = newest_->parts.find(number);
    if (piece == newest_->parts.end() || part >= piece->second)
      return {};  // It belongs to a piece that was never completed.
    if (read_[number]++ != part) return Unreadable("a checkpoint");
    std::string& whole = newest_->pieces[number];
    if (part == 0) {
      whole = std::move(bytes);
    } else {
      whole.append(bytes);
    }
    return {};
  }

  std::optional<StoredCheckpoint> newest_;
  record::CheckpointHead head_;
  std::uint32_t parts_ = 0;                      // How many parts of the main part were read so far.
  std::map<std::uint64_t, std::uint32_t> read_;  // How many parts of each piece were read so far.
};

}  // namespace

// A newer one that is not complete has no head yet.
Result<std::uint64_t> PositionOfCheckpoint(Store& store, std::uint64_t session) {
  const auto numbers = store.Numbers(Range(session, 0, kFirstPiece - 1));
  if (!numbers) return tl::unexpected(numbers.error());
  const auto is_head = [](std::uint64_t number) { return number % kParts == 0; };
  const auto newest = std::ranges::find_if(numbers->rbegin(), numbers->rend(), is_head);
  return newest == numbers->rend() ? 0 : *newest / kParts;
}

Result<std::optional<StoredCheckpoint>> ReadCheckpoint(Store& store, std::uint64_t session) {
  CheckpointReader reader;
  const auto take = [&reader](std::uint64_t number, std::string&& bytes) {
    return reader.Take(number, std::move(bytes));
  };
  if (auto read = store.Read({.kind = RecordKind::kCheckpoint, .owner = session}, take); !read)
    return tl::unexpected(read.error());
  return std::move(reader).Finish();
}

}  // namespace cairn::server
