#include <gmock/gmock.h>

#include <filesystem>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/rows/folder/run_directory.h"
#include "tests/deep_json.h"
#include "tests/rows/rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::episode;
using test::thrown_message;
using test::tiny_run;

EpisodeRow traced(int index) {
  EpisodeRow row = episode("replay", "hug", index, index % 2 == 0);
  row.trace.points = {"root"};
  row.trace.mm = {{1, 2, 3}};
  row.feet.left_mm = row.feet.right_mm = {1, 2};
  return row;
}

class Published : public testing::Test {
 protected:
  Published() {
    RunDirectory run = RunDirectory::open(scratch_ / "run", tiny_run());
    for (int i = 0; i < 3; ++i) run.append(traced(i));
  }
  test::ScratchFolder scratch_;
};

TEST_F(Published, IsTheRunWithoutItsTraces) {
  const std::string folder = scratch_ / "published/tiny";
  publish_run(scratch_ / "run", folder);
  EXPECT_TRUE(is_published(folder));
  EXPECT_FALSE(is_published(scratch_ / "run"));
  const duet::Run before = load_run(scratch_ / "run"), after = load_run(folder);
  ASSERT_EQ(after.rows.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    EpisodeRow lean = before.rows[i];
    lean.trace = {};
    lean.feet = {};
    EXPECT_EQ(to_json(after.rows[i]), to_json(lean));
  }
  EXPECT_EQ(after.info.argv, before.info.argv);
  EXPECT_EQ(after.info.suite_yaml, before.info.suite_yaml);
  EXPECT_EQ(after.info.environment, before.info.environment);
}

TEST_F(Published, DoesNotSayWhereItsMachineKeepsFiles) {
  const std::filesystem::path here = std::filesystem::current_path();
  RunInfo info = tiny_run();
  info.suite_yaml = "networks: [\"" + (here / "runs/a.safetensors").string() + "\", \"" +
                    (here.parent_path() / "b.onnx").string() + "\", c.onnx]\n";
  info.argv = {"duet", "run", "clips.files=[" + (here / "a.npz").string() + "," + (here / "b.npz").string() + "]"};
  info.environment["variables"] = {
      {"DUET_ENGINES", (here / "engines").string() + ":" + (here.parent_path() / "lib").string()},
      {"DUET_HOST", "http://host/a"}};
  RunDirectory::open(scratch_ / "placed", info).append(traced(0));
  publish_run(scratch_ / "placed", scratch_ / "tiny");
  const RunInfo found = load_run(scratch_ / "tiny").info;
  EXPECT_EQ(found.suite_yaml, "networks: [\"runs/a.safetensors\", \"../b.onnx\", c.onnx]\n");
  EXPECT_EQ(found.argv.at(2), "clips.files=[a.npz,b.npz]");
  EXPECT_EQ(found.environment.at("variables"),
            (nlohmann::json{{"DUET_ENGINES", "engines:../lib"}, {"DUET_HOST", "http://host/a"}}));
}

TEST_F(Published, AChangedFileIsRefusedByName) {
  const std::string folder = scratch_ / "tiny";
  publish_run(scratch_ / "run", folder);
  for (const char* name : {"episodes.jsonl", "suite.yaml"}) {
    const std::string file = folder + "/" + name, text = read_file(file);
    write_file(file, text + "\n");
    EXPECT_SENTENCE(thrown_message<InputError>([&] { load_run(folder); }));
    write_file(file, text);
  }
  EXPECT_EQ(load_run(folder).rows.size(), 3U);
  std::filesystem::remove(folder + "/env.json");
  EXPECT_SENTENCE(thrown_message<InputError>([&] { load_run(folder); }));
  write_file(folder + "/manifest.json", R"({"schema": "duet.published/2", "files": {}})");
  EXPECT_SENTENCE(thrown_message<InputError>([&] { load_run(folder); }));
}

TEST_F(Published, AManifestThatNestsWithoutEndIsRefused) {
  const std::string folder = scratch_ / "tiny";
  publish_run(scratch_ / "run", folder);
  write_file(folder + "/manifest.json", "{\"schema\":" + test::deep_json() + "}");
  EXPECT_EQ(thrown_message<InputError>([&] { load_run(folder); }),
            folder + "/manifest.json: " + std::string(test::kTooDeep));
}

TEST_F(Published, AManifestThatNamesFilesElsewhereIsRefused) {
  const std::string folder = scratch_ / "tiny";
  publish_run(scratch_ / "run", folder);
  write_file(folder + "/manifest.json",
             R"({"schema": "duet.published/1", "files": {"episodes.jsonl": "", "../../secret": ""}})");
  EXPECT_EQ(thrown_message<InputError>([&] { load_run(folder); }),
            folder + "/manifest.json: key 'files': expected names of files in the folder, found '../../secret'");
}

TEST_F(Published, DoesNotGrow) {
  publish_run(scratch_ / "run", scratch_ / "tiny");
  EXPECT_SENTENCE(thrown_message<InputError>([&] { RunDirectory::open(scratch_ / "tiny", tiny_run()); }));
  EXPECT_SENTENCE(thrown_message<InputError>([&] { publish_run(scratch_ / "run", scratch_ / "tiny"); }));
}

TEST_F(Published, OfNothingIsRefusedAndLeavesNothing) {
  EXPECT_SENTENCE(thrown_message<InputError>([&] { publish_run(scratch_ / "none", scratch_ / "tiny"); }));
  RunDirectory::open(scratch_ / "empty", tiny_run());
  EXPECT_SENTENCE(thrown_message<InputError>([&] { publish_run(scratch_ / "empty", scratch_ / "tiny"); }));
  EXPECT_FALSE(std::filesystem::exists(scratch_ / "tiny"));
  for (const auto& entry : std::filesystem::directory_iterator(scratch_ / "."))
    EXPECT_THAT(entry.path().filename().string(), testing::AnyOf("run", "empty"));
}

TEST_F(Published, LeavesWhatOthersHaveBesideIt) {
  write_file(scratch_ / "tiny.partial/precious", "mine");
  publish_run(scratch_ / "run", scratch_ / "tiny");
  EXPECT_EQ(read_file(scratch_ / "tiny.partial/precious"), "mine");
  EXPECT_EQ(load_run(scratch_ / "tiny").rows.size(), 3U);
}

TEST_F(Published, HasTheFilesThatAreNamedAndNoOthers) {
  write_file(scratch_ / "run/inputs/a.txt", "named");
  write_file(scratch_ / "run/inputs/b.txt", "not named");
  publish_run(scratch_ / "run", scratch_ / "tiny", {.files = {"inputs/a.txt"}, .texts = {{"inputs/c.txt", "made"}}});
  EXPECT_EQ(read_file(scratch_ / "tiny/inputs/a.txt"), "named");
  EXPECT_EQ(read_file(scratch_ / "tiny/inputs/c.txt"), "made");
  EXPECT_FALSE(std::filesystem::exists(scratch_ / "tiny/inputs/b.txt"));
}

// Links in the place of a file that is named, of one that is not, and of a folder on the way.
TEST_F(Published, ALinkIsRefused) {
  write_file(scratch_ / "secret/a.txt", "secret");
  const auto refusal = [&](const std::string& link, const std::string& target) {
    std::filesystem::create_directories(scratch_ / "run/inputs");
    std::filesystem::create_symlink(scratch_ / target, scratch_ / link);
    std::string said = thrown_message<InputError>(
        [&] { publish_run(scratch_ / "run", scratch_ / "tiny", {.files = {"inputs/a.txt"}}); });
    std::filesystem::remove(scratch_ / link);
    EXPECT_FALSE(std::filesystem::exists(scratch_ / "tiny"));
    return said;
  };
  for (const char* text : {"run/inputs/a.txt", "run/inputs/x.txt", "run/resumed.jsonl"})
    EXPECT_SENTENCE(refusal(text, "secret/a.txt"));
  std::filesystem::remove_all(scratch_ / "run/inputs");
  std::filesystem::create_symlink(scratch_ / "secret", scratch_ / "run/inputs");
  EXPECT_SENTENCE(thrown_message<InputError>(
      [&] { publish_run(scratch_ / "run", scratch_ / "tiny", {.files = {"inputs/a.txt"}}); }));
}

// Checks what this project publishes.
TEST(PublishedRuns, AreWhatTheirManifestsSay) {
  const std::string folder = DUET_SOURCE_DIR "/results/published";
  ASSERT_TRUE(std::filesystem::exists(folder));
  for (const std::filesystem::directory_entry& entry : std::filesystem::directory_iterator(folder)) {
    if (!entry.is_directory()) continue;
    EXPECT_TRUE(is_published(entry.path().string())) << entry.path();
    EXPECT_FALSE(load_run(entry.path().string()).rows.empty()) << entry.path();
  }
}

}  // namespace
}  // namespace duet
