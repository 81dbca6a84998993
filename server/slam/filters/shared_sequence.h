// A sequence that copies share until one of them changes it: copying takes O(1), reading, changing and appending
// O(log16 n), and a change clones only the nodes on its way down that somebody else also holds. This is what lets 200
// particles carry 200 maps and 200 paths for the price of their differences.
// Not thread-safe; copies may be used from different threads as long as each copy stays with one thread and nobody
// changes a sequence while it is being copied. (A node's use count is only trusted when it says "mine alone".)
// Source: the shared landmark trees of Montemerlo's FastSLAM (2002, 3.4), as a radix-16 trie.
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <utility>

namespace cairn::slam {

template <typename Value>
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

  // For writing: afterwards this sequence alone holds the element's node. REQUIRES: index < size().
  [[nodiscard]] Value& Mutable(std::size_t index) {
    std::shared_ptr<void>* link = &root_;
    for (int shift = shift_; shift > 0; shift -= kBits) link = &Own<Branch>(*link).children[Slot(index, shift)];
    return Own<Leaf>(*link).values[Slot(index, 0)];
  }

  void Append(Value value) {
    if (!root_) root_ = std::make_shared<Leaf>();
    if (size_ == (std::size_t{kWidth} << shift_)) {  // Full: one storey more.
      auto storey = std::make_shared<Branch>();
      storey->children[0] = std::move(root_);
      root_ = std::move(storey);
      shift_ += kBits;
    }
    const std::size_t index = size_++;
    std::shared_ptr<void>* link = &root_;
    for (int shift = shift_; shift > 0; shift -= kBits) {
      link = &Own<Branch>(*link).children[Slot(index, shift)];
      if (!*link) *link = shift == kBits ? std::shared_ptr<void>(std::make_shared<Leaf>()) : std::make_shared<Branch>();
    }
    Own<Leaf>(*link).values[Slot(index, 0)] = std::move(value);
  }

 private:
  static constexpr int kBits = 4;
  static constexpr int kWidth = 1 << kBits;
  struct Leaf {
    std::array<Value, kWidth> values{};
  };
  struct Branch {
    std::array<std::shared_ptr<void>, kWidth> children{};
  };

  static std::size_t Slot(std::size_t index, int shift) { return (index >> shift) & (kWidth - 1); }

  template <typename Node>
  static Node& Own(std::shared_ptr<void>& link) {
    if (link.use_count() > 1) link = std::make_shared<Node>(*static_cast<const Node*>(link.get()));
    return *static_cast<Node*>(link.get());
  }

  std::shared_ptr<void> root_;
  std::size_t size_ = 0;
  int shift_ = 0;  // Bits below the root's slot.
};

}  // namespace cairn::slam
