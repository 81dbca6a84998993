#include "server/store/set_aside.h"

#include <algorithm>
#include <utility>

namespace cairn::server {
namespace {

constexpr std::size_t kLongestText = 600;  // A status has room for 1,024 bytes, and there may be other reasons.

}  // namespace

std::string SetAside::Add(const std::string& site, const std::string& what, const Status& why) {
  Entry entry{site, what + " is set aside: " + why.message};
  std::string line = entry.line;
  const MutexLock lock(mutex_);
  if (std::find(entries_.begin(), entries_.end(), entry) == entries_.end()) entries_.push_back(std::move(entry));
  return line;
}

void SetAside::RemoveSite(const std::string& site) {
  const MutexLock lock(mutex_);
  std::erase_if(entries_, [&site](const Entry& entry) { return entry.site == site; });
}

std::string SetAside::text() const {
  const MutexLock lock(mutex_);
  std::string text;
  std::size_t told = 0;
  for (const Entry& entry : entries_) {
    if (told > 0 && text.size() + entry.line.size() > kLongestText) break;
    text += (told++ == 0 ? "" : "; ") + entry.line.substr(0, kLongestText);
  }
  if (told < entries_.size()) text += "; and " + std::to_string(entries_.size() - told) + " more, which the log names";
  return text;
}

Result<void> ReadEach(Store& store, const RecordRange& range, const Store::Visit& visit,
                      const std::function<void(std::uint64_t number, const Status& why)>& unreadable) {
  const auto numbers = store.Numbers(range);
  if (!numbers) return tl::unexpected(numbers.error());
  for (const std::uint64_t number : *numbers) {
    const auto read = store.Read({.kind = range.kind, .owner = range.owner, .first = number, .last = number}, visit);
    if (!read) unreadable(number, read.error());
  }
  return {};
}

}  // namespace cairn::server
