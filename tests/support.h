// Shared by the tests: optional data, a scratch folder, the message of an exception, sentences of the golden file.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

namespace duet::test {

// Path of a file of the shared reference data, "" where it is absent. A test that needs it then says
// GTEST_SKIP() << "not run: <name> absent".
inline std::string shared_file(const std::string& name) {
  const char* root = std::getenv("DUET_SHARED");
  const std::filesystem::path path =
      std::filesystem::path(root != nullptr ? root : std::string(DUET_SOURCE_DIR) + "/../shared") / name;
  return std::filesystem::exists(path) ? path.string() : "";
}

// A fresh folder that is removed at the end of the test.
class ScratchFolder {
 public:
  ScratchFolder() {
    std::string pattern = (std::filesystem::temp_directory_path() / "duet-test-XXXXXX").string();
    path_ = mkdtemp(pattern.data());
  }
  ~ScratchFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  [[nodiscard]] std::string operator/(const std::string& name) const { return (path_ / name).string(); }

 private:
  std::filesystem::path path_;
};

// The message of the exception of type E that `action` throws, or a sentence that says it threw none or another.
template <typename E, typename Action>
std::string thrown_message(Action&& action) {
  try {
    action();
  } catch (const E& error) {
    return error.what();
  } catch (const std::exception& error) {
    return std::string("(another type of exception: ") + error.what() + ")";
  }
  return "(nothing was thrown)";
}

// Whether the room's golden file has `message` whole, as the next sentence of this test (tests/sentences.cpp).
::testing::AssertionResult is_sentence(const char* expression, const std::string& message);
::testing::AssertionResult is_sentence(const char* expression, const std::vector<std::string>& lines);

// What users read is compared whole with tests/sentences/<room>.txt, which `./run sentences <room>` writes.
#define EXPECT_SENTENCE(...) EXPECT_PRED_FORMAT1(::duet::test::is_sentence, (__VA_ARGS__))

}  // namespace duet::test
