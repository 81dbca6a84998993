// Bytes: the length of the main part and the main part; then, until the end, the length and the bytes of each shared
// value, in the order of their numbers.
#include "server/slam/state/archive.h"

#include <algorithm>

namespace cairn::slam {

void StateWriter::RawAcrossBlocks(const char* data, std::size_t size) {
  while (size > 0) {
    if (free_ == 0) {
      blocks_.push_back(std::make_unique_for_overwrite<char[]>(kBlockSize));
      end_ = blocks_.back().get();
      free_ = kBlockSize;
    }
    const std::size_t part = std::min(size, free_);
    std::memcpy(end_, data, part);
    end_ += part;
    free_ -= part;
    data += part;
    size -= part;
  }
}

void StateWriter::Clear() {
  nodes_.clear();
  next_node_ = 0;
  if (blocks_.empty()) return;
  blocks_.resize(1);
  end_ = blocks_.front().get();
  free_ = kBlockSize;
}

void StateWriter::AppendLengthTo(std::string& bytes) const {
  const std::uint64_t length = size();
  bytes.append(reinterpret_cast<const char*>(&length), sizeof(length));
}

void StateWriter::AppendTo(std::string& bytes) const {
  std::size_t left = size();
  for (const auto& block : blocks_) {
    const std::size_t part = std::min(left, kBlockSize);
    bytes.append(block.get(), part);
    left -= part;
  }
}

std::string StatePiece::Bytes() const {
  StateWriter writer;
  write(writer, value.get());
  std::string bytes;
  writer.AppendTo(bytes);
  return bytes;
}

std::string StateWriter::Main() const {
  std::string bytes;
  AppendLengthTo(bytes);
  AppendTo(bytes);
  return bytes;
}

std::string StateWriter::Bytes() const {
  std::string bytes = Main();
  StateWriter writer;
  for (const StatePiece& shared : immutable_) {
    writer.Clear();
    shared.write(writer, shared.value.get());
    writer.AppendLengthTo(bytes);
    writer.AppendTo(bytes);
  }
  return bytes;
}

std::vector<std::shared_ptr<const void>> StateReader::values() const {
  std::vector<std::shared_ptr<const void>> values;
  for (std::size_t i = first_piece_; i < immutable_.size(); ++i) values.push_back(immutable_[i].value);
  return values;
}

StateReader::StateReader(std::string_view bytes, std::span<const std::string_view> pieces, std::uint32_t format)
    : rest_(bytes), format_(format) {
  const auto part = [this] {
    std::uint64_t size = 0;
    Get(size);
    Require(size <= rest_.size(), "a length");
    const std::string_view read = rest_.substr(0, ok() ? size : 0);
    rest_.remove_prefix(read.size());
    return read;
  };
  const std::string_view main = part();
  while (ok() && !rest_.empty()) immutable_.push_back({part(), nullptr, nullptr});
  first_piece_ = immutable_.size();
  for (const std::string_view piece : pieces) immutable_.push_back({piece, nullptr, nullptr});
  rest_ = ok() ? main : std::string_view{};
}

bool StateReader::Require(bool holds, const char* what) {
  if (!holds && ok()) {
    failed_ = what;
    rest_ = {};
  }
  return ok();
}

void StateReader::Raw(void* data, std::size_t size) {
  if (size == 0) return;
  if (size > rest_.size()) {
    std::memset(data, 0, size);
    Require(false, "the length");
    return;
  }
  std::memcpy(data, rest_.data(), size);
  rest_.remove_prefix(size);
}

std::size_t StateReader::Size(std::size_t bytes_per_element) {
  std::uint64_t size = 0;
  Get(size);
  return Require(size <= rest_.size() / bytes_per_element, "a number of elements") ? static_cast<std::size_t>(size) : 0;
}

}  // namespace cairn::slam
