// When a session takes its checkpoints, and what it does when nothing of it was stored for a while (session.h).
#include <utility>

#include "common/thread_time.h"
#include "server/robots/session.h"

namespace cairn::server {

void Session::SetCheckpointed(std::uint64_t position, std::uint64_t last) {
  pace_.RestoredFrom(position);
  end_unsaved_ = !failed_ && record_.phase() == SessionPhase::kEnded && last > position;
}

void Session::TakeCheckpoint() {
  if (failed_ || stopping() || !outputs_.position || !outputs_.checkpoint) return;
  if (outputs_.checkpointing && outputs_.checkpointing()) return;
  const std::uint64_t position = outputs_.position();
  if (position == 0) {
    if (lost_ && outputs_.recover) StoreAgain();
  } else if (lost_) {
    // Lost came from another thread, about an entry before StoreAgain, and took back what that had begun.
    outputs_.abandon();
  } else if (record_.phase() == SessionPhase::kEnded) {
    if (end_unsaved_ && SaveAt(position, {})) end_unsaved_ = false;
  } else if (pace_.IsDue(position) && !SaveAt(position, {})) {
    pace_.Refused();
    if (!pace_.IsOverdue(position)) return;
    outputs_.abandon();
    Lost({StatusCode::kUnavailable, "no checkpoint of it could be made for very long"});
  }
}

// Nothing of the session was stored for a while: what came meanwhile is in the checkpoint that begins this.
void Session::StoreAgain() {
  const std::uint64_t position = outputs_.recover();
  if (position == 0) return;
  lost_ = false;
  const auto done = [weak = weak_from_this(), position](bool stored) {
    const auto self = weak.lock();
    if (self == nullptr) return;
    if (!stored) {
      self->lost_ = true;  // Housekeeping tries again.
    } else if (self->record_.StoredAgain(position)) {
      self->AnnounceState();
      self->PublishLedgers(SessionRecord::Urgency::kNow);
    }
  };
  try {
    estimator_.BeginStoring(position);
    if (SaveAt(position, done)) return;
  } catch (...) {
    outputs_.abandon();
    throw;
  }
  outputs_.abandon();
  record_.SetStored(false);
  lost_ = true;
}

bool Session::SaveAt(std::uint64_t position, Journal::Done done) {
  const auto begin = ThreadTime();
  auto save = estimator_.Save();
  // Samples that were settled meanwhile are in the record, but perhaps not in the journal before this position.
  if (!save || stopping() || outputs_.position() != position) return false;
  auto content = [save = std::move(save), saving = ThreadTime() - begin, cost = pace_.cost()] {
    const auto making = ThreadTime();
    CheckpointContent made = save();
    *cost = (saving + (ThreadTime() - making)).count();
    for (CheckpointPiece& piece : made.pieces) {
      piece.bytes = [bytes = std::move(piece.bytes), cost] {
        const auto writing = ThreadTime();
        std::string written = bytes();
        *cost += (ThreadTime() - writing).count();
        return written;
      };
    }
    return made;
  };
  if (!outputs_.checkpoint(position, std::move(content), std::move(done))) return false;
  pace_.Begun(position);
  estimator_.RepeatSuggestion();
  return true;
}

}  // namespace cairn::server
