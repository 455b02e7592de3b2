// The program around the tests of a room, and its golden file: tests/sentences/<room>.txt holds the sentences that
// users read, by test, in the order in which a test asks for them. DUET_SENTENCES=write writes the file anew (`./run
// sentences`).
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <regex>
#include <vector>

#include "tests/support.h"

namespace duet::test {
namespace {

const std::string kSource = DUET_SOURCE_DIR;

std::string literally(const std::string& text) {
  return std::regex_replace(text, std::regex(R"([.\\+*?^$()\[\]{}|])"), R"(\$&)");
}

// The folder in which tests/<room>/<room>_test was built.
std::string build_folder() {
  return std::filesystem::read_symlink("/proc/self/exe").parent_path().parent_path().parent_path();
}

// Parts that differ from machine to machine or from run to run: folders of tests, of the build and of the
// sources, engines that are built beside the benchmark's, nodes and processes, digests of programs and inputs (not
// those that a test makes up of one digit).
std::string normalised(std::string text) {
  static const std::string temporary = literally(std::filesystem::temp_directory_path().string());
  static const std::vector<std::pair<std::regex, std::string>> rules = {
      {std::regex(temporary + R"(/duet-test-\w{6})"), "<scratch>"},
      {std::regex(temporary + "/duet-"), "<temp>/duet-"},
      {std::regex(literally(build_folder())), "<build>"},
      {std::regex(literally(kSource)), "<source>"},
      {std::regex("(mujoco, bullet, ode, simbody, dart)(?:, \\w+)+"), "$1"},
      {std::regex(R"((attempts/\d+)/[\w.-]+-\d+-[0-9a-f]{8}\b)"), "$1/<node, process>"},
      {std::regex(R"(\b(?!([0-9a-f])\1{63})[0-9a-f]{64}\b)"), "<SHA-256>"},
      {std::regex(R"(\b(?!([0-9a-f])\1{11})[0-9a-f]{12}\b)"), "<digest>"}};
  for (const auto& [pattern, name] : rules) text = std::regex_replace(text, pattern, name);
  return text;
}

// Bytes that a text file does not hold, as \x1b; ends of lines stay.
std::string printable(const std::string& text) {
  std::string shown;
  for (const char letter : text) {
    const auto byte = static_cast<unsigned char>(letter);
    const bool plain = letter == '\n' || (byte >= 0x20 && byte != 0x7f);
    shown += plain ? std::string(1, letter) : fmt::format("\\x{:02x}", byte);
  }
  return shown;
}

// Sentences of each test. "- " begins one, "| " goes on in its next line, "* 3 times" follows one that comes thrice.
using SentencesByTest = std::map<std::string, std::vector<std::string>>;

SentencesByTest read_sentences(const std::string& path) {
  SentencesByTest all;
  std::ifstream file(path);
  std::string line, test;
  while (std::getline(file, line)) {
    const std::string text = line.size() > 2 ? line.substr(2) : "";
    if (line.empty() || line[0] == '#') continue;
    if (line[0] == '-')
      all[test].push_back(text);
    else if (line[0] == '|' && !all[test].empty())
      all[test].back() += "\n" + text;
    else if (line[0] == '*' && !all[test].empty())
      all[test].resize(all[test].size() + std::stoul(text) - 1, all[test].back());
    else
      all.try_emplace(test = line);
  }
  return all;
}

void write_sentence(std::ostream& file, const std::string& sentence) {
  char mark = '-';
  for (size_t begin = 0; begin <= sentence.size(); mark = '|') {
    const size_t end = std::min(sentence.find('\n', begin), sentence.size());
    file << mark << (end > begin ? " " : "") << sentence.substr(begin, end - begin) << "\n";
    begin = end + 1;
  }
}

void write_sentences(const std::string& path, const std::string& room, const SentencesByTest& all) {
  std::ofstream file(path);
  file << "# The sentences that the tests of " << room << " compare whole. `./run sentences " << room
       << "` writes this file.\n";
  for (const auto& [test, sentences] : all) {
    if (sentences.empty()) continue;
    file << "\n" << test << "\n";
    for (size_t first = 0, end = 0; first < sentences.size(); first = end) {
      while (end < sentences.size() && sentences[end] == sentences[first]) ++end;
      write_sentence(file, sentences[first]);
      if (end - first > 1) file << "* " << end - first << " times\n";
    }
  }
}

class GoldenSentences final : public ::testing::EmptyTestEventListener {
 public:
  explicit GoldenSentences(std::string room)
      : room_(std::move(room)),
        path_(kSource + "/tests/sentences/" + room_ + ".txt"),
        golden_(read_sentences(path_)),
        now_(golden_) {
    const char* mode = std::getenv("DUET_SENTENCES");
    writes_ = mode != nullptr && std::string(mode) == "write";
  }

  void OnTestStart(const ::testing::TestInfo& /*info*/) override { asked_.clear(); }

  ::testing::AssertionResult compare(const char* expression, const std::string& message) {
    asked_.push_back(printable(normalised(message)));
    if (writes_) return ::testing::AssertionSuccess();
    const auto found = golden_.find(name_of(*::testing::UnitTest::GetInstance()->current_test_info()));
    const std::vector<std::string> expected = found == golden_.end() ? std::vector<std::string>{} : found->second;
    const size_t place = asked_.size() - 1;
    if (place < expected.size() && expected[place] == asked_.back()) return ::testing::AssertionSuccess();
    return ::testing::AssertionFailure() << fmt::format(
               "sentence {} of this test in {}, {}\nexpected: {}\n   found: {}\nif that is right, ./run sentences {}",
               place + 1, path_, expression, place < expected.size() ? expected[place] : "(no sentence)", asked_.back(),
               room_);
  }

  // A test that was skipped, or left early, has not asked for all.
  void OnTestEnd(const ::testing::TestInfo& info) override {
    if (info.result()->Skipped() || info.result()->HasFatalFailure()) return;
    const std::string name = name_of(info);
    now_[name] = asked_;
    if (writes_ || info.result()->Failed()) return;
    const auto found = golden_.find(name);
    const size_t expected = found == golden_.end() ? 0 : found->second.size();
    EXPECT_EQ(asked_.size(), expected) << "the number of sentences that this test asks for; " << path_
                                       << " has another: ./run sentences " << room_;
  }

  // False where the file has a test that is not there. Writes it first where it is to be written.
  [[nodiscard]] bool close() {
    std::vector<std::string> gone;
    for (const auto& [test, sentences] : golden_)
      if (!is_there(test)) gone.push_back(test);
    if (writes_) {
      for (const std::string& test : gone) now_.erase(test);
      write_sentences(path_, room_, now_);
      return true;
    }
    for (const std::string& test : gone)
      std::cerr << path_ << ": no test '" << test << "' is there: ./run sentences " << room_ << "\n";
    return gone.empty();
  }

 private:
  static std::string name_of(const ::testing::TestInfo& info) {
    return std::string(info.test_suite_name()) + "." + info.name();
  }
  static bool is_there(const std::string& test) {
    const ::testing::UnitTest& all = *::testing::UnitTest::GetInstance();
    for (int s = 0; s < all.total_test_suite_count(); ++s)
      for (int t = 0; t < all.GetTestSuite(s)->total_test_count(); ++t)
        if (name_of(*all.GetTestSuite(s)->GetTestInfo(t)) == test) return true;
    return false;
  }

  std::string room_, path_;
  SentencesByTest golden_, now_;
  std::vector<std::string> asked_;
  bool writes_ = false;
};

GoldenSentences* golden = nullptr;  // GoogleTest owns it, as it does each listener

}  // namespace

::testing::AssertionResult is_sentence(const char* expression, const std::string& message) {
  return golden->compare(expression, message);
}

::testing::AssertionResult is_sentence(const char* expression, const std::vector<std::string>& lines) {
  return golden->compare(expression, fmt::format("{}", fmt::join(lines, "\n")));
}

}  // namespace duet::test

int main(int count, char** arguments) {
  ::testing::InitGoogleMock(&count, arguments);
  const std::string program = std::filesystem::path(arguments[0]).filename();
  duet::test::golden = new duet::test::GoldenSentences(program.substr(0, program.rfind("_test")));
  ::testing::UnitTest::GetInstance()->listeners().Append(duet::test::golden);
  const int code = RUN_ALL_TESTS();
  return duet::test::golden->close() ? code : 1;
}
