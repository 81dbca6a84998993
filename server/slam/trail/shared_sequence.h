// A sequence that copies share until one of them changes it. Copying takes O(1) time; reading, changing and
// appending take O(log16 n). A change clones only those nodes on the way to the element that another copy
// also holds. This allows 200 particles to carry 200 maps and 200 paths at the cost of their differences.
// Not thread-safe. Copies may be used from different threads if each copy stays with one thread and no
// sequence is changed while it is being copied. (A node's use count is relied on only when it shows a single
// owner.)
// Source: the shared landmark trees of Montemerlo's FastSLAM (2002, 3.4), as a radix-16 trie.
#pragma once

#include <algorithm>
#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <unordered_map>
#include <utility>
#include <vector>

namespace cairn::slam {

// What a node of a sequence knows of the values below it: here nothing. Others (pose_path.h) take up each value, and
// each summary of a part, with Add. A value that was replaced stays in the summaries.
struct NoSummary {
  void Add(const auto& /*value_or_part*/) {}
};

template <typename Value, typename Summary = NoSummary>
class SharedSequence {
 public:
  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] bool empty() const { return size_ == 0; }

  // REQUIRES: index < size().
  [[nodiscard]] const Value& operator[](std::size_t index) const {
    const void* node = root_.get();
    for (int shift = shift_; shift > 0; shift -= kBits)
      node = static_cast<const Branch*>(node)->children[Slot(index, shift)].get();
    return static_cast<const Leaf*>(node)->values[Slot(index, 0)];
  }

  // A reference for writing. Afterwards only this sequence holds the element's node. REQUIRES: index <
  // size().
  [[nodiscard]] Value& Mutable(std::size_t index) requires std::same_as<Summary, NoSummary> {
    std::shared_ptr<void>* link = &root_;
    for (int shift = shift_; shift > 0; shift -= kBits) link = &Own<Branch>(*link).children[Slot(index, shift)];
    return Own<Leaf>(*link).values[Slot(index, 0)];
  }

  // Nodes as they were, and as Rewrite has made them. The former are held so that no new node gets the address of one.
  struct RewrittenNode {
    std::shared_ptr<void> before;
    std::shared_ptr<void> after;
  };
  using Rewritten = std::unordered_map<const void*, RewrittenNode>;
  // Calls change(index, value) for every value, and for some beyond the end. Sequences that share nodes share them
  // afterwards if all are given the same `done`, and shared values are changed once; other copies do not change.
  template <typename Change>
  void Rewrite(const Change& change, Rewritten& done) requires std::same_as<Summary, NoSummary> {
    if (size_ > 0) RewriteNode(root_, 0, shift_, change, done);
  }

  // Replaces a value. REQUIRES: index < size().
  void Set(std::size_t index, Value value) { Put(index, std::move(value)); }

  // A copy of all values in order.
  [[nodiscard]] std::vector<Value> values() const {
    std::vector<Value> values;
    values.reserve(size_);
    for (std::size_t i = 0; i < size_; ++i) values.push_back((*this)[i]);
    return values;
  }

  void Append(Value value) {
    if (!root_) root_ = std::make_shared<Leaf>();
    if (size_ == (std::size_t{kWidth} << shift_)) {  // The tree is full and gets one more level.
      auto level = std::make_shared<Branch>();
      level->summary = SummaryOf(root_.get(), shift_);
      level->children[0] = std::move(root_);
      root_ = std::move(level);
      shift_ += kBits;
    }
    Put(size_++, std::move(value));
  }

  // Calls visit(index, value) in order for the values from `begin` on and before `end`, but for those below nodes whose
  // summary `enter` refuses. `enter` may also take the index of the first value below the node and that after the last.
  // REQUIRES: end <= size().
  template <typename Enter, typename Visitor>
  void ForEach(std::size_t begin, std::size_t end, const Enter& enter, const Visitor& visit) const {
    if (begin < end) VisitNode(root_.get(), 0, {begin, end}, shift_, enter, visit);
  }
  template <typename Enter, typename Visitor>
  void ForEach(std::size_t end, const Enter& enter, const Visitor& visit) const {
    ForEach(0, end, enter, visit);
  }

  // How many of the first `end` values are the same as those of `other`. Nodes that both share are not looked into.
  // REQUIRES: end <= size(), end <= other.size().
  [[nodiscard]] std::size_t SharedWith(const SharedSequence& other, std::size_t end) const {
    if (end == 0) return 0;
    const void* mine = root_.get();
    const void* theirs = other.root_.get();
    int shift = shift_, other_shift = other.shift_;
    for (; shift > other_shift; shift -= kBits) mine = static_cast<const Branch*>(mine)->children[0].get();
    for (; other_shift > shift; other_shift -= kBits) theirs = static_cast<const Branch*>(theirs)->children[0].get();
    return SharedBelow(mine, theirs, end, shift);
  }

  // The state, for archives (state/archive.h). Copies that share nodes share them again when they are read.
  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    std::uint64_t size = self.size_;
    archive(size);
    if constexpr (Archive::kReads) {
      self = {};
      if (!archive.Require(size <= kMostRead, "the size of a sequence")) return;
      self.size_ = size;
      while (self.size_ > (std::size_t{kWidth} << self.shift_)) self.shift_ += kBits;
    }
    if (self.size_ > 0) NodeMembers(archive, self.root_, self.size_, self.shift_);
  }

 private:
  static constexpr int kBits = 4;
  static constexpr int kWidth = 1 << kBits;
  static constexpr std::uint64_t kMostRead = 1 << 24;
  struct Leaf {
    std::array<Value, kWidth> values{};
    [[no_unique_address]] Summary summary;
  };
  struct Branch {
    std::array<std::shared_ptr<void>, kWidth> children{};
    [[no_unique_address]] Summary summary;
  };

  static std::size_t Slot(std::size_t index, int shift) { return (index >> shift) & (kWidth - 1); }

  static const Summary& SummaryOf(const void* node, int shift) {
    return shift == 0 ? static_cast<const Leaf*>(node)->summary : static_cast<const Branch*>(node)->summary;
  }

  // The nodes on the way to the last element may be missing.
  void Put(std::size_t index, Value value) {
    std::shared_ptr<void>* link = &root_;
    for (int shift = shift_; shift > 0; shift -= kBits) {
      auto& branch = Own<Branch>(*link);
      branch.summary.Add(value);
      link = &branch.children[Slot(index, shift)];
      if (!*link) *link = shift == kBits ? std::shared_ptr<void>(std::make_shared<Leaf>()) : std::make_shared<Branch>();
    }
    auto& leaf = Own<Leaf>(*link);
    leaf.summary.Add(value);
    leaf.values[Slot(index, 0)] = std::move(value);
  }

  struct Range {
    std::size_t begin = 0;
    std::size_t end = 0;
  };

  // `first`: the index of the first value below the node.
  static void VisitNode(const void* node, std::size_t first, const Range& range, int shift, const auto& enter,
                        const auto& visit) {
    const auto enters = [&](const Summary& summary) {
      if constexpr (std::invocable<decltype(enter), const Summary&>) {
        return enter(summary);
      } else {
        return enter(summary, first, std::min(first + (std::size_t{kWidth} << shift), range.end));
      }
    };
    if (!enters(SummaryOf(node, shift))) return;
    for (std::size_t i = 0; i < kWidth; ++i) {
      const std::size_t at = first + (i << shift);
      if (at >= range.end) return;
      if (shift > 0 && at + (std::size_t{1} << shift) > range.begin) {
        VisitNode(static_cast<const Branch*>(node)->children[i].get(), at, range, shift - kBits, enter, visit);
      } else if (shift == 0 && at >= range.begin) {
        visit(at, static_cast<const Leaf*>(node)->values[i]);
      }
    }
  }

  // How many of the first `end` values below two nodes are the same.
  static std::size_t SharedBelow(const void* a, const void* b, std::size_t end, int shift) {
    if (a == b) return end;
    std::size_t same = 0;
    for (std::size_t i = 0; same < end; ++i) {
      if (shift == 0) {
        if (!(static_cast<const Leaf*>(a)->values[i] == static_cast<const Leaf*>(b)->values[i])) return same;
        ++same;
        continue;
      }
      const std::size_t below = std::min(end - same, std::size_t{1} << shift);
      const std::size_t found = SharedBelow(static_cast<const Branch*>(a)->children[i].get(),
                                            static_cast<const Branch*>(b)->children[i].get(), below, shift - kBits);
      same += found;
      if (found < below) return same;
    }
    return same;
  }

  // A node with the first `count` elements below it.
  template <typename Archive>
  static void NodeMembers(Archive& archive, auto& link, std::size_t count, int shift) {
    const std::uint64_t shape = (std::uint64_t{count} << 8) | static_cast<std::uint64_t>(shift);
    if (shift == 0) {
      if (!archive.template Shared<Leaf>(link, shape)) return;
      auto& leaf = *static_cast<Leaf*>(link.get());
      for (std::size_t i = 0; i < count && archive.ok(); ++i) {
        archive(leaf.values[i]);
        if constexpr (Archive::kReads) leaf.summary.Add(leaf.values[i]);
      }
      return;
    }
    if (!archive.template Shared<Branch>(link, shape)) return;
    auto& branch = *static_cast<Branch*>(link.get());
    for (std::size_t i = 0, left = count; left > 0 && archive.ok(); ++i) {
      const std::size_t below = std::min(left, std::size_t{1} << shift);
      NodeMembers(archive, branch.children[i], below, shift - kBits);
      if constexpr (Archive::kReads)
        if (branch.children[i]) branch.summary.Add(SummaryOf(branch.children[i].get(), shift - kBits));
      left -= below;
    }
  }

  static void RewriteNode(std::shared_ptr<void>& link, std::size_t first, int shift, const auto& change,
                          Rewritten& done) {
    if (!link) return;
    if (const auto known = done.find(link.get()); known != done.end()) {
      link = known->second.after;
      return;
    }
    const std::shared_ptr<void> before = link;
    if (shift == 0) {
      auto leaf = std::make_shared<Leaf>(*static_cast<const Leaf*>(before.get()));
      for (std::size_t i = 0; i < kWidth; ++i) change(first + i, leaf->values[i]);
      link = std::move(leaf);
    } else {
      auto branch = std::make_shared<Branch>(*static_cast<const Branch*>(before.get()));
      for (std::size_t i = 0; i < kWidth; ++i)
        RewriteNode(branch->children[i], first + (i << shift), shift - kBits, change, done);
      link = std::move(branch);
    }
    done.emplace(before.get(), RewrittenNode{before, link});
  }

  template <typename Node>
  static Node& Own(std::shared_ptr<void>& link) {
    if (link.use_count() > 1) {
      link = std::make_shared<Node>(*static_cast<const Node*>(link.get()));
      return *static_cast<Node*>(link.get());
    }
    // The last other owner may have been a checkpoint on another thread. Taking and giving back the node once more puts
    // what that thread has read before what is written now.
    const std::shared_ptr<void> synchronised = link;
    return *static_cast<Node*>(link.get());
  }

  std::shared_ptr<void> root_;
  std::size_t size_ = 0;
  int shift_ = 0;  // Number of index bits below the root's slot.
};

}  // namespace cairn::slam
