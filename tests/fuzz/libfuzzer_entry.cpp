// The entry points of libFuzzer for the one target in this program. With `--seeds=DIR` the target's seeds are written
// there first, so that DIR can be given as a corpus as well (libFuzzer leaves arguments with two dashes alone).
#include <filesystem>
#include <fstream>

#include "tests/fuzz/fuzz_target.h"

extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv) {
  constexpr std::string_view kSeeds = "--seeds=";
  for (int i = 1; i < *argc; ++i) {
    const std::string_view argument = (*argv)[i];
    if (argument.substr(0, kSeeds.size()) != kSeeds) continue;
    const std::filesystem::path directory = argument.substr(kSeeds.size());
    std::filesystem::create_directories(directory);
    int number = 0;
    for (const std::string& seed : cairn::fuzz::Targets().at(0).seeds())
      std::ofstream(directory / ("seed" + std::to_string(number++)), std::ios::binary) << seed;
  }
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  static_cast<void>(cairn::fuzz::Targets().at(0).run({reinterpret_cast<const char*>(bytes), size}));
  return 0;
}
