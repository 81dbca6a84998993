// Writes the state of the estimator as bytes, and reads it back. Every class with a state lists its members once:
//
//   template <typename Archive>
//   static void Members(Archive& archive, auto& self) { archive(self.pose_, self.path_); }
//
// This list is used for writing and for reading, so that both always agree. Options are not part of the state: a state
// is read into an object that was made with the same options (scan_pipeline.h checks that). `archive.Require` checks
// the conditions on which the rest of the class relies, such as valid indices and sizes. If one does not hold while
// reading, the reading fails, and the values read so far must not be used. Immutable values (std::shared_ptr<const T>:
// scans, parts of the map) are not written at once. The writer shares them until Bytes() writes them, which may be
// called on another thread; as long as a value is shared, whoever wants to change it makes a copy. Other shared nodes
// (SharedSequence) are written once in the main part and once in each immutable value, and are shared there again after
// reading. An immutable value must not contain immutable values. Later() makes an immutable value of what is cheap to
// copy and slow to write. All numbers are little-endian. The same state gives the same bytes. Not thread-safe.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <cstring>
#include <deque>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <unordered_map>
#include <utility>
#include <vector>

#include "common/geometry/pose2.h"
#include "server/slam/state/value_members.h"

namespace cairn::slam {

static_assert(std::endian::native == std::endian::little, "archives copy numbers as they are in memory");

template <typename T>
concept Number = std::is_arithmetic_v<T> || std::is_enum_v<T>;
// Every element of a sequence of these may be copied as it is: any bits are a value.
template <typename T>
concept PlainNumber = std::is_arithmetic_v<T> && !std::same_as<T, bool>;
template <typename T>
concept FixedMatrix = std::is_base_of_v<Eigen::PlainObjectBase<T>, T> && T::SizeAtCompileTime != Eigen::Dynamic;
// Reads and writes a value that is cheap to copy, by means of shared nodes: what is written is the copy.
template <typename T>
struct Later {
  T& value;

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    using Value = std::remove_const_t<T>;
    std::shared_ptr<const Value> copy;
    if constexpr (!Archive::kReads) copy = std::make_shared<const Value>(self.value);
    archive(copy);
    if constexpr (Archive::kReads)
      if (archive.ok()) self.value = *copy;
  }
};
template <typename T>
Later(T&) -> Later<T>;

// The address of kKindOf<T> stands for the type T.
template <typename T>
inline constexpr char kKindOf = 0;

// The version of what is written; it grows when the members of a class change. A reader is told which version it reads,
// so that a class that has got a member later can leave it as it is.
inline constexpr std::uint32_t kStateFormat = 15;

class StateWriter;

// An immutable value that a state shares. Bytes may be called from any thread.
struct StatePiece {
  std::shared_ptr<const void> value;
  void (*write)(StateWriter& writer, const void* value) = nullptr;

  [[nodiscard]] std::string Bytes() const;
};

class StateWriter {
 public:
  static constexpr bool kReads = false;

  template <typename... Values>
  void operator()(const Values&... values) {
    (Put(values), ...);
  }
  bool Require(bool /*holds*/, const char* /*what*/) { return true; }
  [[nodiscard]] static constexpr bool ok() { return true; }
  void SetKeyframes(std::size_t /*count*/) {}
  void RequireKeyframe(std::size_t /*index*/) {}

  // Writes which of the shared nodes this is; `shape` (not 0) is what is known of its content. True if it is new: its
  // content must follow.
  template <typename Node>
  bool Shared(const std::shared_ptr<void>& node, std::uint64_t shape) {
    NodeSeen& seen = nodes_[node.get()];
    const bool fresh = seen.shape != shape;
    if (fresh) seen = {next_node_++, shape};
    Put(seen.id);
    return fresh;
  }

  // Everything written so far, with the immutable values that it shares. They are written here, so that the time is
  // spent by whoever calls this. May be called from any thread, if nothing is written any more.
  [[nodiscard]] std::string Bytes() const;
  // The same in two parts, for those who have the bytes of some immutable values already: Bytes() is Main() and then
  // the length and the bytes of each piece.
  [[nodiscard]] std::string Main() const;
  [[nodiscard]] const std::vector<StatePiece>& pieces() const { return immutable_; }

 private:
  friend struct StatePiece;
  struct NodeSeen {
    std::uint32_t id = 0;
    std::uint64_t shape = 0;
  };

  static constexpr std::size_t kBlockSize = 1 << 20;

  void Raw(const void* data, std::size_t size) {
    if (size == 0) return;  // `data` may be null then.
    if (size > free_) return RawAcrossBlocks(static_cast<const char*>(data), size);
    std::memcpy(end_, data, size);
    end_ += size;
    free_ -= size;
  }
  void RawAcrossBlocks(const char* data, std::size_t size);
  // Forgets what was written and which nodes were, but keeps the memory.
  void Clear();
  [[nodiscard]] std::size_t size() const { return blocks_.size() * kBlockSize - free_; }
  void AppendTo(std::string& bytes) const;
  void AppendLengthTo(std::string& bytes) const;

  template <typename T>
  void Put(const T& value) {
    if constexpr (Number<T>) {
      Raw(&value, sizeof(value));
    } else if constexpr (FixedMatrix<T>) {
      Raw(value.data(), sizeof(typename T::Scalar) * T::SizeAtCompileTime);
    } else if constexpr (requires { T::Members(*this, value); }) {
      T::Members(*this, value);
    } else {
      MembersOf(*this, value);
    }
  }
  template <typename T>
  void Put(const std::shared_ptr<const T>& value) {
    const auto [seen, fresh] = immutable_ids_.try_emplace(value.get(), static_cast<std::uint32_t>(immutable_.size()));
    if (fresh)
      immutable_.push_back(
          {value, [](StateWriter& writer, const void* data) { writer.Put(*static_cast<const T*>(data)); }});
    Put(seen->second);
  }
  template <typename T>
  void Put(const std::optional<T>& value) {
    Put(value.has_value());
    if (value) Put(*value);
  }
  template <typename T, std::size_t N>
  void Put(const std::array<T, N>& values) {
    if constexpr (PlainNumber<T>) return Raw(values.data(), sizeof(values));
    for (const T& value : values) Put(value);
  }
  template <typename T>
  void Put(const std::vector<T>& values) {
    if constexpr (PlainNumber<T>) {
      Put(static_cast<std::uint64_t>(values.size()));
      Raw(values.data(), values.size() * sizeof(T));
    } else {
      PutEach(values);
    }
  }
  template <typename T>
  void Put(const std::deque<T>& values) {
    PutEach(values);
  }
  template <typename T>
  void Put(const std::set<T>& values) {
    PutEach(values);
  }
  void Put(const std::string& text) {
    Put(static_cast<std::uint64_t>(text.size()));
    Raw(text.data(), text.size());
  }
  template <typename Values>
  void PutEach(const Values& values) {
    Put(static_cast<std::uint64_t>(values.size()));
    for (const auto& value : values) Put(value);
  }

  // What was written, in blocks that never move: growing memory would be copied, which takes longer than all the rest.
  std::vector<std::unique_ptr<char[]>> blocks_;
  char* end_ = nullptr;   // Where the last block goes on,
  std::size_t free_ = 0;  // and how much of it is left.
  std::unordered_map<const void*, NodeSeen> nodes_;
  std::uint32_t next_node_ = 0;
  std::unordered_map<const void*, std::uint32_t> immutable_ids_;
  std::vector<StatePiece> immutable_;
};

class StateReader {
 public:
  static constexpr bool kReads = true;
  static constexpr double kLargest = 1e12;  // No length, angle or weight of an estimator is larger.

  // `bytes` are the result of StateWriter::Bytes, or of Main with the bytes of the pieces in their order, or anything
  // else; they must outlive the reader.
  explicit StateReader(std::string_view bytes, std::span<const std::string_view> pieces = {},
                       std::uint32_t format = kStateFormat);
  [[nodiscard]] std::uint32_t format() const { return format_; }

  template <typename... Values>
  void operator()(Values&... values) {
    (Get(values), ...);
  }
  // Fails if `holds` is false; `what` names what is wrong. Returns whether nothing has failed so far.
  bool Require(bool holds, const char* what);
  // The same with a function that is called only if nothing has failed so far: it may rely on everything that was
  // required before, also by the parts that were read.
  bool RequireThat(const std::predicate auto& holds, const char* what) { return ok() && Require(holds(), what); }
  [[nodiscard]] bool ok() const { return failed_ == nullptr; }
  // What is wrong, if something is.
  [[nodiscard]] const char* failed() const { return failed_; }
  // Whether everything has been read.
  [[nodiscard]] bool done() const { return ok() && rest_.empty(); }
  // Whether so many bytes are left. For what takes memory before it is read.
  [[nodiscard]] bool Holds(std::size_t bytes) const { return bytes <= rest_.size(); }
  // The values of `pieces`, in their order. Null: it was not needed.
  [[nodiscard]] std::vector<std::shared_ptr<const void>> values() const;

  // The number of keyframes, to which the indices that follow must belong.
  void SetKeyframes(std::size_t count) { keyframes_ = count; }
  void RequireKeyframe(std::size_t index) { Require(index < keyframes_, "the number of a keyframe"); }
  [[nodiscard]] std::size_t keyframes() const { return keyframes_; }

  // Sets the node to the one that was written. True if it is new: its content must follow.
  template <typename Node>
  bool Shared(std::shared_ptr<void>& node, std::uint64_t shape) {
    std::uint32_t id = 0;
    Get(id);
    if (!Require(id <= nodes_.size(), "a shared node")) return false;
    if (id < nodes_.size()) {
      if (Require(nodes_[id].kind == &kKindOf<Node> && nodes_[id].shape == shape, "the kind of a shared node"))
        node = nodes_[id].node;
      return false;
    }
    node = std::make_shared<Node>();
    nodes_.push_back({node, &kKindOf<Node>, shape});
    return true;
  }

 private:
  struct NodeRead {
    std::shared_ptr<void> node;
    const char* kind = nullptr;
    std::uint64_t shape = 0;
  };
  struct Immutable {
    std::string_view bytes;
    std::shared_ptr<const void> value;  // Null until it is needed for the first time.
    const char* kind = nullptr;
  };

  void Raw(void* data, std::size_t size);
  // The size of a sequence whose elements take at least one byte each.
  [[nodiscard]] std::size_t Size(std::size_t bytes_per_element);

  template <typename T>
  void Get(T& value) {
    if constexpr (std::same_as<T, bool>) {
      std::uint8_t byte = 0;
      Raw(&byte, 1);
      Require(byte <= 1, "a flag");
      value = byte == 1;
    } else if constexpr (Number<T>) {
      Raw(&value, sizeof(value));
      if constexpr (std::is_floating_point_v<T>) Require(std::isinf(value) || std::abs(value) <= kLargest, "a number");
    } else if constexpr (FixedMatrix<T>) {
      Raw(value.data(), sizeof(typename T::Scalar) * T::SizeAtCompileTime);
      Require(value.allFinite(), "a matrix");
    } else if constexpr (requires { T::Members(*this, value); }) {
      T::Members(*this, value);
    } else {
      MembersOf(*this, value);
    }
  }
  template <typename T>
  void Get(std::shared_ptr<const T>& value) {
    std::uint32_t id = 0;
    Get(id);
    if (!Require(id < immutable_.size(), "a shared value")) return;
    Immutable& shared = immutable_[id];
    if (!shared.value) {
      auto read = std::make_shared<T>();
      const std::string_view rest = std::exchange(rest_, shared.bytes);
      std::vector<NodeRead> nodes = std::exchange(nodes_, {});
      Get(*read);
      nodes_ = std::move(nodes);
      Require(rest_.empty(), "the length of a shared value");
      rest_ = ok() ? rest : std::string_view{};
      if (!ok()) return;
      shared.value = std::move(read);
      shared.kind = &kKindOf<T>;
    }
    if (Require(shared.kind == &kKindOf<T>, "the kind of a shared value"))
      value = std::static_pointer_cast<const T>(shared.value);
  }
  template <typename T>
  void Get(std::optional<T>& value) {
    bool has = false;
    Get(has);
    value.reset();
    if (!has) return;
    value = T{};
    Get(*value);
  }
  template <typename T, std::size_t N>
  void Get(std::array<T, N>& values) {
    if constexpr (PlainNumber<T>) return Raw(values.data(), sizeof(values));
    for (T& value : values) Get(value);
  }
  template <typename T>
  void Get(std::vector<T>& values) {
    if constexpr (PlainNumber<T>) {
      values.resize(Size(sizeof(T)));
      Raw(values.data(), values.size() * sizeof(T));
    } else {
      GetEach(values);
    }
  }
  template <typename T>
  void Get(std::deque<T>& values) {
    GetEach(values);
  }
  template <typename T>
  void Get(std::set<T>& values) {
    values.clear();
    const std::size_t size = Size(1);
    for (std::size_t i = 0; i < size && ok(); ++i) {
      T value{};
      Get(value);
      values.insert(value);
    }
  }
  void Get(std::string& text) {
    text.resize(Size(1));
    Raw(text.data(), text.size());
  }
  template <typename Values>
  void GetEach(Values& values) {
    values.clear();
    const std::size_t size = Size(1);
    // What was not checked yet takes no more memory than twice the bytes that are there.
    if constexpr (requires { values.reserve(size); })
      values.reserve(std::min(size, 2 * rest_.size() / sizeof(typename Values::value_type)));
    for (std::size_t i = 0; i < size && ok(); ++i) Get(values.emplace_back());
  }

  std::string_view rest_;
  const char* failed_ = nullptr;
  std::size_t keyframes_ = 0;
  std::vector<NodeRead> nodes_;
  std::vector<Immutable> immutable_;  // Those in `bytes`, then the pieces.
  std::size_t first_piece_ = 0;
  std::uint32_t format_;
};

}  // namespace cairn::slam
