// Runs every target over its seeds, its kept corpus and the inputs that once failed, in every build. A failure aborts:
// the last line before it names the input.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "tests/fuzz/fuzz_target.h"

namespace cairn::fuzz {
namespace {

class Replay : public testing::Test {
 public:
  explicit Replay(const Target& target) : target_(target) {}

  void TestBody() override {
    int number = 0;
    for (const std::string& seed : target_.seeds())
      EXPECT_TRUE(Run(seed, "seed " + std::to_string(number++))) << "a seed must be accepted";
    EXPECT_GT(number, 0);
    const char* const source = std::getenv("CAIRN_SOURCE_DIR");
    ASSERT_NE(source, nullptr);
    for (const char* kind : {"corpus", "regressions"}) {
      const auto folder = std::filesystem::path(source) / "tests/fuzz" / kind / target_.name;
      if (!std::filesystem::is_directory(folder)) continue;
      for (const auto& file : std::filesystem::directory_iterator(folder)) {
        std::ifstream in(file.path(), std::ios::binary);
        Run({std::istreambuf_iterator<char>(in), {}}, file.path().string());
      }
    }
  }

 private:
  bool Run(const std::string& input, const std::string& from) const {
    std::fprintf(stderr, "%s: %s\n", target_.name, from.c_str());
    const std::vector<char> exact(input.begin(), input.end());  // A byte beyond is seen by the address sanitizer.
    const long before_KiB = PeakMemory_KiB();
    const bool accepted = target_.run({exact.data(), exact.size()});
    EXPECT_LT(PeakMemory_KiB() - before_KiB, 512 * 1024) << from;
    return accepted;
  }
  static long PeakMemory_KiB() {
    rusage used{};
    getrusage(RUSAGE_SELF, &used);
    return used.ru_maxrss;
  }

  const Target target_;
};

}  // namespace
}  // namespace cairn::fuzz

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  for (const cairn::fuzz::Target& target : cairn::fuzz::Targets())
    testing::RegisterTest("FuzzReplay", target.name, nullptr, nullptr, __FILE__, __LINE__,
                          [target]() -> testing::Test* { return new cairn::fuzz::Replay(target); });
  return RUN_ALL_TESTS();
}
