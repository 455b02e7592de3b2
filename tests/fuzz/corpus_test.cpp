// Every reader over its samples, over the files of tests/fuzz/corpus and over seeded damage, without a fuzzer: a reader
// gives a value or refuses with one sentence; it throws nothing else and does not end the program.
#include <gmock/gmock.h>

#include <filesystem>

#include "duet/core/file.h"
#include "duet/core/numbers.h"
#include "duet/core/require.h"
#include "tests/deep_json.h"
#include "tests/fuzz/reader.h"

namespace duet::fuzz {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLongestSentence = 4500;  // a list of known names is the longest

// "" where the bytes were read, the sentence where they were refused.
std::string refusal(const Reader& reader, const std::string& bytes, const std::string& what) {
  try {
    reader.read(bytes);
    return "";
  } catch (const InputError& error) {
    const std::string sentence = error.what();
    EXPECT_FALSE(sentence.empty()) << what;
    EXPECT_LT(sentence.size(), kLongestSentence) << what << ": " << sentence.substr(0, 300);
    EXPECT_EQ(sentence.find('\x1b'), std::string::npos) << what << ": " << sentence.substr(0, 300);
    return sentence;
  } catch (const std::exception& error) {
    ADD_FAILURE() << what << ": expected an InputError, found another exception: " << error.what();
    return error.what();
  }
}

class Readers : public testing::TestWithParam<Reader> {};

TEST_P(Readers, TakeTheirSamples) {
  for (const unsigned seed : {0U, 64U, 128U, 192U, 256U, 320U, 384U})
    EXPECT_EQ(refusal(GetParam(), GetParam().sample(seed), "sample"), "") << seed;
}

TEST_P(Readers, TakeOrRefuseTheCorpus) {
  const fs::path folder = fs::path(DUET_SOURCE_DIR "/tests/fuzz/corpus") / GetParam().name;
  ASSERT_TRUE(fs::exists(folder)) << folder;
  int files = 0;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    refusal(GetParam(), read_file(entry.path().string()), entry.path().string());
    ++files;
  }
  EXPECT_GT(files, 0);
}

// Where a sample is text: its first value nested without end, its first name very long and coloured.
TEST_P(Readers, RefuseWhatNestsWithoutEnd) {
  const std::string sample = GetParam().sample(0);
  for (const char first : {':', '=', '>', ' ', '\n'}) {
    const std::size_t at = std::min(sample.find(first) + 1, sample.size());
    for (const std::string& deep : {test::deep_json(), std::string(200'000, '{'), std::string(200'000, '('),
                                    "\x1b[31m" + std::string(99'999, 'x')})
      refusal(GetParam(), sample.substr(0, at) + deep + sample.substr(at), "deep");
  }
  std::string elements;
  for (int i = 0; i < 50'000; ++i) elements += "<a>";
  refusal(GetParam(), elements, "elements");
  refusal(GetParam(), std::string(kSeparator) + elements, "elements of the second file");
}

TEST_P(Readers, TakeOrRefuseDamagedSamples) {
  Random random(4, 2);
  for (int i = 0; i < 100; ++i) {
    std::string bytes = GetParam().sample(static_cast<unsigned>(i));
    for (int edits = 0; edits <= i % 4 && !bytes.empty(); ++edits) {
      const auto at = static_cast<std::size_t>(random.below(static_cast<int>(bytes.size())));
      if (i % 3 == 0) bytes[at] = static_cast<char>(random.bits());
      if (i % 3 == 1) bytes.erase(at, 1 + random.bits() % 16);
      if (i % 3 == 2) bytes.insert(at, bytes.substr(at / 2, 16));
    }
    refusal(GetParam(), bytes, "damaged sample " + std::to_string(i));
  }
}

INSTANTIATE_TEST_SUITE_P(Of, Readers, testing::ValuesIn(all_readers()),
                         [](const auto& info) { return std::string(info.param.name); });

}  // namespace
}  // namespace duet::fuzz
