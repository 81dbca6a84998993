// How a checkpoint saves a long sequence that only grows at its end, such as the keyframes of a day: in blocks that are
// copied once, when they are full, and that all later checkpoints share. Saving then takes the time of what is new and
// not of all there is; the bytes of the blocks are made by whoever makes those of the checkpoint (archive.h). The
// sequence itself stays a vector, to which this belongs. Not thread-safe; the blocks never change.
#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#include "server/slam/state/archive.h"

namespace cairn::slam {

// What an element's pointers point to is saved inside the block: `T::InlineMembers` where it has such members, and
// pointers to values that never change of themselves. Several in a row that are the same are saved once.
template <typename T>
class FrozenBlocks {
 public:
  // Whoever changes an element or shortens the sequence calls this with the first one concerned; otherwise later
  // checkpoints contain the old values.
  void ForgetFrom(std::size_t first) {
    blocks_.resize(std::min(blocks_.size(), first / static_cast<std::size_t>(kBlock)));
  }
  void Forget() { blocks_.clear(); }

  void Save(StateWriter& archive, const std::vector<T>& values) const {
    while ((blocks_.size() + 1) * kBlock <= values.size()) {
      const auto first = values.begin() + static_cast<std::ptrdiff_t>(blocks_.size() * kBlock);
      blocks_.push_back(std::make_shared<const Block>(Block{{first, first + kBlock}}));
    }
    const auto rest = values.begin() + static_cast<std::ptrdiff_t>(blocks_.size() * kBlock);
    archive(blocks_, std::make_shared<const Block>(Block{{rest, values.end()}}));
  }
  void Load(StateReader& archive, std::vector<T>& values) {
    std::shared_ptr<const Block> rest;
    archive(blocks_, rest);
    values.clear();
    if (!archive.ok()) return;
    for (const auto& block : blocks_)
      if (archive.Require(block->values.size() == kBlock, "a block")) Append(*block, values);
    Append(*rest, values);
    // The next checkpoint would refer to their bytes as if they had its own format.
    if (archive.format() != kStateFormat) blocks_.clear();
  }

 private:
  static constexpr std::ptrdiff_t kBlock = 256;

  struct Block {
    std::vector<T> values;

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      std::uint64_t size = self.values.size();
      archive(size);
      if constexpr (Archive::kReads)
        if (archive.Require(size <= kBlock, "the size of a block")) self.values.resize(size);
      for (std::size_t i = 0; i < self.values.size() && archive.ok(); ++i) Element(archive, self.values, i);
    }
  };

  template <typename Archive>
  static void Element(Archive& archive, auto& values, std::size_t i) {
    if constexpr (requires { T::InlineMembers(archive, values[i]); }) {
      T::InlineMembers(archive, values[i]);
    } else if constexpr (requires { typename T::element_type; }) {
      bool same = i > 0 && values[i] == values[i - 1];
      archive(same);
      if constexpr (Archive::kReads) {
        if (!archive.Require(i > 0 || !same, "an element of a block")) return;
        auto read = std::make_shared<std::remove_const_t<typename T::element_type>>();
        if (!same) archive(*read);
        values[i] = same ? values[i - 1] : std::move(read);
      } else if (!same) {
        archive(*values[i]);
      }
    } else {
      archive(values[i]);
    }
  }

  static void Append(const Block& block, std::vector<T>& values) {
    values.insert(values.end(), block.values.begin(), block.values.end());
  }

  mutable std::vector<std::shared_ptr<const Block>> blocks_;
};

// The same list of members for both directions.
template <typename T>
void InBlocks(StateWriter& archive, const FrozenBlocks<T>& blocks, const std::vector<T>& values) {
  blocks.Save(archive, values);
}
template <typename T>
void InBlocks(StateReader& archive, FrozenBlocks<T>& blocks, std::vector<T>& values) {
  blocks.Load(archive, values);
}

}  // namespace cairn::slam
