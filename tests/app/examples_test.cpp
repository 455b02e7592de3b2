// Every example that a --help shows: its options are those of the command, and what is quick runs as printed.
#include <gmock/gmock.h>

#include <filesystem>
#include <map>
#include <regex>
#include <sstream>

#include "tests/app/program.h"

namespace duet {
namespace {

using test::duet_program;

struct Example {
  std::string command;    // "train pack"
  std::string arguments;  // as printed, without "duet"
  std::string help;       // of the command
};

std::vector<std::string> words_of(const std::string& line) {
  std::istringstream stream(line);
  std::vector<std::string> words;
  for (std::string word; stream >> word;) words.push_back(word);
  return words;
}

// Names below "Subcommands:", the first word of lines that are indented by two.
std::vector<std::string> subcommands(const std::string& help) {
  std::vector<std::string> names;
  std::istringstream lines(help.substr(std::min(help.find("ubcommands:"), help.size())));
  const std::regex entry("^  ([a-z][a-z0-9_-]*)( .*)?$");
  std::smatch match;
  for (std::string line; std::getline(lines, line);)
    if (std::regex_match(line, match, entry) && match[1] != "duet") names.push_back(match[1]);
  return names;
}

void add_examples(const std::string& command, std::vector<Example>& examples) {
  const std::string help = duet_program(command + " --help").out;
  for (const std::string& name : subcommands(help))
    add_examples(command.empty() ? name : command + " " + name, examples);
  std::istringstream lines(help.substr(std::min(help.find("Example:"), help.size())));
  for (std::string line; std::getline(lines, line);)
    if (line.starts_with("  duet ")) examples.push_back({command, line.substr(7), help});
}

std::vector<Example> all_examples() {
  std::vector<Example> examples;
  add_examples("", examples);
  return examples;
}

TEST(Examples, EveryOptionOfEveryExampleIsTheCommands) {
  const std::vector<Example> examples = all_examples();
  EXPECT_GE(examples.size(), 25u);
  for (const Example& example : examples) {
    EXPECT_TRUE(example.arguments.starts_with(example.command)) << example.arguments;
    for (const std::string& word : words_of(example.arguments)) {
      if (!word.starts_with("-")) continue;
      const std::regex option("(^|[\\s,])" + word + "($|[\\s,\\[])");
      EXPECT_TRUE(std::regex_search(example.help, option)) << example.arguments << ": " << word;
    }
  }
}

// The world of the examples, small: what they read is there under the names that they use.
void make_world(const std::string& root) {
  const auto in_root = [&](const std::string& arguments) {
    const test::Answer answer = duet_program(arguments + " -q", "cd " + root + ";");
    ASSERT_EQ(answer.code, 0) << arguments << answer.err;
  };
  const std::string head =
      "schema: duet.suite/1\nversion: 1.0.0\nclips: {synth: {per_task: 1}}\ntasks: [handshake]\n"
      "engines: [playback]\npolicies: [replay]\nstart: clip\nrecord: {trajectories: all}\n";
  write_file(root + "/suites/core.yaml", head + "name: core\ncontrollers: [pd]\n");
  write_file(root + "/suites/controllers.yaml", head + "name: controllers\ncontrollers: [pd, homie]\n");
  write_file(root + "/deploy.onnx", "a network that is not looked into");
  in_root("synth handshake -n 1 -o clips");
  in_root("retarget clips -o paired");
  in_root("run suites/core.yaml -o runs/core");
  for (const char* run : {"policy_a", "policy_b", "policies"})
    std::filesystem::copy(root + "/runs/core", root + "/runs/" + run, std::filesystem::copy_options::recursive);
  in_root("bless runs/core -o golden/core.json");
  const std::string clip = std::filesystem::directory_iterator(root + "/clips")->path().string();
  std::filesystem::copy(clip, root + "/handshake.npz");
  std::filesystem::copy(std::filesystem::directory_iterator(root + "/paired")->path().string(),
                        root + "/handshake_paired.npz");
  std::filesystem::create_directories(root + "/examples");
  std::filesystem::create_directory_symlink(DUET_SOURCE_DIR "/examples/data", root + "/examples/data");
  const std::string bvh = test::shared_file("data/cmu_handshake"),
                    pickle = test::shared_file("data/g1_motions/twist2/walk_001.pkl");
  if (!bvh.empty()) std::filesystem::copy(bvh, root);
  if (!pickle.empty()) std::filesystem::copy(pickle, root);
}

// Arguments that an example needs besides; commands that are not named take long or need what is not everywhere.
const std::map<std::string, std::string>& quick_commands() {
  static const std::map<std::string, std::string> commands = {
      {"bless", ""}, {"check", ""},   {"compare", ""}, {"convert", ""},    {"import", ""},
      {"list", ""},  {"publish", ""}, {"report", ""},  {"retarget", ""},   {"run", "--dry-run"},
      {"score", ""}, {"synth", ""},   {"verify", ""},  {"train split", ""}};
  return commands;
}

TEST(Examples, QuickOnesRunAsPrinted) {
  const test::ScratchFolder folder;
  const std::string root = folder / "world";
  std::filesystem::create_directories(root + "/policies/dstar");
  ASSERT_NO_FATAL_FAILURE(make_world(root));
  int run = 0;
  for (const Example& example : all_examples()) {
    const auto quick = quick_commands().find(example.command);
    if (quick == quick_commands().end()) continue;
    const bool there =
        example.command != "import" || std::filesystem::exists(root + "/" + words_of(example.arguments).at(1));
    if (!there) {
      std::printf("not run: %s (shared data absent)\n", example.arguments.c_str());
      continue;
    }
    const std::string program = quick->second + " " + example.arguments.substr(example.command.size());
    const test::Answer answer = duet_program(example.command + " " + program, "cd " + root + ";");
    EXPECT_EQ(answer.code, 0) << "duet " << example.arguments << "\n" << answer.err;
    ++run;
  }
  EXPECT_GE(run, 14);
}

}  // namespace
}  // namespace duet
