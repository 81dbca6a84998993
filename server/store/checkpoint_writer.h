// Writes the checkpoint of a session, over several commits, so that a large one does not delay other commits. It
// consists of a main part and of pieces. A piece never changes, and later checkpoints that still contain it refer to
// the records that are already on the disk, so that a checkpoint takes the time and the space of what is new. The main
// part and each piece are written in records of 1 MiB. Its head is written last and completes the checkpoint; in the
// same commit older main parts, and pieces that this checkpoint does not contain, are removed. Record numbers: head
// position * 65,536, part n of the main part position * 65,536 + n, first part of piece n 2^63 + n, part m of piece n
// (from 1 on) 2^63 + 2^62 + n * 65,536 + m. Earlier servers wrote each piece as one record. Not thread-safe.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "server/store/store.h"

namespace cairn::server {

struct CheckpointPiece {
  std::shared_ptr<const void> value;  // The same value is the same piece. It must not change as long as it is shared.
  std::function<std::string()> bytes;
};
struct CheckpointContent {
  std::string main;
  std::vector<CheckpointPiece> pieces = {};
};

// The pieces of the newest checkpoint on the disk, by number.
struct StoredPiece {
  std::shared_ptr<const void> value = nullptr;  // Null: it is not in memory.
  std::uint32_t parts = 1;
};
using StoredPieces = std::map<std::uint64_t, StoredPiece>;

class CheckpointWriter {
 public:
  static constexpr std::size_t kPartBytes = std::size_t{1} << 20;
  static constexpr std::size_t kBytesPerCommit = 4 * kPartBytes;

  CheckpointWriter(std::uint64_t session, std::uint64_t position, CheckpointContent content, StoredPieces stored = {});

  // Adds the next records to a commit that is about to be made. Throws std::length_error if the main part or a piece
  // takes more than 65,535 records: there are no numbers for so many.
  void AddTo(RecordChanges& changes);
  // Whether everything, including the head, has been added to commits.
  [[nodiscard]] bool complete() const { return complete_; }
  [[nodiscard]] std::uint64_t session() const { return session_; }
  [[nodiscard]] std::uint64_t position() const { return position_; }
  // What is stored when it is complete.
  [[nodiscard]] const StoredPieces& pieces() const { return pieces_; }

 private:
  struct NewPiece {
    std::uint64_t number = 0;
    std::function<std::string()> bytes;
  };
  void Number(std::vector<CheckpointPiece> pieces);
  std::size_t AddPiecePart(RecordChanges& changes);
  std::size_t AddMainPart(RecordChanges& changes);
  void Complete(RecordChanges& changes);
  void Remove(std::uint64_t piece, std::uint32_t parts, RecordChanges& changes) const;

  const std::uint64_t session_;
  const std::uint64_t position_;
  const std::string main_;
  const StoredPieces stored_;
  StoredPieces pieces_;
  std::vector<std::uint64_t> order_;
  std::vector<NewPiece> new_pieces_;
  bool begun_ = false;
  std::size_t pieces_written_ = 0;
  std::string piece_;              // The piece that is being written,
  std::size_t piece_written_ = 0;  // how many of its bytes are,
  std::uint32_t piece_parts_ = 0;  // and in how many records. 0: it was not begun.
  std::uint32_t parts_ = 0;
  std::size_t written_ = 0;  // Bytes of the main part.
  bool complete_ = false;
};

// The newest complete checkpoint of a session.
struct StoredCheckpoint {
  std::uint64_t position = 0;
  std::string bytes;  // The main part.
  std::map<std::uint64_t, std::string> pieces;
  std::vector<std::uint64_t> order;              // Numbers of the pieces; none twice.
  std::map<std::uint64_t, std::uint32_t> parts;  // In how many records each piece is.

  [[nodiscard]] std::vector<std::string_view> PiecesInOrder() const;
};
// Its position. 0: there is none. Its content is not read.
[[nodiscard]] Result<std::uint64_t> PositionOfCheckpoint(Store& store, std::uint64_t session);
// DATA_LOSS: it is damaged, or a part of it is missing.
[[nodiscard]] Result<std::optional<StoredCheckpoint>> ReadCheckpoint(Store& store, std::uint64_t session);

}  // namespace cairn::server
