#include "common/file/atomic_file.h"

#include <gtest/gtest.h>

#include "tests/temp_directory.h"

namespace cairn {
namespace {

int FilesIn(const TempDirectory& directory) {
  return static_cast<int>(std::distance(std::filesystem::directory_iterator(directory.path()), {}));
}

TEST(AtomicFile, ReplacesTheWholeContent) {
  const TempDirectory directory;
  ASSERT_TRUE(WriteFileAtomically(directory / "f", std::string(100'000, 'a')));
  ASSERT_TRUE(WriteFileAtomically(directory / "f", std::string_view("b\0c", 3)));
  EXPECT_EQ(directory.Read("f"), std::string("b\0c", 3));
  EXPECT_EQ(FilesIn(directory), 1);
}

TEST(AtomicFile, FailureLeavesTheOldContentAndNoTemporary) {
  const TempDirectory directory;
  std::filesystem::create_directories(directory / "taken" / "inside");  // A rename over it must fail.
  const auto result = WriteFileAtomically(directory / "taken", "x");
  ASSERT_FALSE(result);
  EXPECT_NE(result.error().message.find("taken"), std::string::npos);
  EXPECT_EQ(FilesIn(directory), 1);
  EXPECT_TRUE(std::filesystem::is_directory(directory / "taken" / "inside"));
}

TEST(AtomicFile, AMissingDirectoryIsNotFound) {
  EXPECT_EQ(WriteFileAtomically("/nonexistent/f", "x").error().code, StatusCode::kNotFound);
}

TEST(ReadWholeFile, ReadsUpToItsBound) {
  const TempDirectory directory;
  const auto path = directory.Write("f", "12345");
  EXPECT_EQ(ReadWholeFile(path, 5)->size(), 5u);
  EXPECT_EQ(ReadWholeFile(path, 4).error().code, StatusCode::kResourceExhausted);
  EXPECT_EQ(ReadWholeFile(directory.path(), 5).error().code, StatusCode::kNotFound);
  EXPECT_EQ(ReadWholeFile(directory / "none", 5).error().code, StatusCode::kNotFound);
  EXPECT_TRUE(ReadWholeFile(directory.Write("empty", ""), 0)->empty());
}

}  // namespace
}  // namespace cairn
