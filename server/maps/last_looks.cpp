#include "server/maps/last_looks.h"

#include <algorithm>

namespace cairn::server {
namespace {

constexpr std::size_t kMostSessions = 255;  // Of one chunk; numbers are bytes.

}  // namespace

void LastLooks::Note(SessionId session, const slam::CellMask& cells) {
  std::uint8_t number = NumberOf(session);
  if (number == 0) {
    auto free = std::ranges::find(sessions_, SessionId{0});
    if (free == sessions_.end() && sessions_.size() == kMostSessions) {
      Forget(sessions_.front());
      free = sessions_.begin();
    }
    if (free == sessions_.end()) free = sessions_.insert(free, session);
    *free = session;
    number = static_cast<std::uint8_t>(free - sessions_.begin() + 1);
  }
  for (std::size_t cell = 0; cell < numbers_.size(); ++cell)
    if (cells.Has(cell)) numbers_[cell] = number;
}

void LastLooks::Replace(SessionId session, SessionId by) {
  const std::uint8_t from = NumberOf(session), to = NumberOf(by);
  if (from == 0) return;
  if (to == 0) {
    sessions_[from - 1U] = by;
    return;
  }
  Renumber(from, to);
}

void LastLooks::Forget(SessionId session) {
  const std::uint8_t number = NumberOf(session);
  if (number != 0) Renumber(number, 0);
}

void LastLooks::ForgetWhereDifferent(SessionId session, const slam::GridChunk& before, const slam::GridChunk& now) {
  const std::uint8_t number = NumberOf(session);
  if (number == 0) return;
  for (std::size_t cell = 0; cell < numbers_.size(); ++cell) {
    const std::int16_t then = before.log_odds[cell], odds = now.log_odds[cell];
    const bool same = odds != slam::kUnseen && (then > 0) == (odds > 0);
    if (numbers_[cell] == number && !same) numbers_[cell] = 0;
  }
}

std::uint8_t LastLooks::NumberOf(SessionId session) const {
  const auto found = std::ranges::find(sessions_, session);
  return found == sessions_.end() ? std::uint8_t{0} : static_cast<std::uint8_t>(found - sessions_.begin() + 1);
}

void LastLooks::Renumber(std::uint8_t from, std::uint8_t to) {
  std::ranges::replace(numbers_, from, to);
  sessions_[from - 1U] = 0;
}

}  // namespace cairn::server
