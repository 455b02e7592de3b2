#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <set>

#include "duet/archives/mcap.h"
#include "duet/archives/npy/npz.h"
#include "duet/archives/recording_file.h"
#include "duet/core/json.h"
#include "duet/core/require.h"
#include "duet/motion/paired_motion.h"
#include "duet/motion/synthesis/synthesis.h"
#include "duet/replay/replay_content.h"
#include "duet/replay/replay_header.h"
#include "duet/replay/replay_page.h"
#include "duet/replay/replay_source.h"
#include "duet/replay/robot_outline.h"
#include "duet/retarget/solver/pair.h"
#include "duet/robots/kinematics.h"
#include "duet/robots/robot_cards.h"
#include "duet/rows/json_fields.h"
#include "tests/app/program.h"
#include "tests/execution/verified_run.h"
#include "tests/experiment/fixtures.h"
#include "tests/file_size_limit.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

// Reads columns as viewer/src/columns.ts does.
Eigen::MatrixXd read_columns(const std::string& bytes, const nlohmann::json& block) {
  const auto at = block.at("at").get<std::size_t>(), rows = block.at("rows").get<std::size_t>();
  const auto bases = block.at("bases").get<std::vector<double>>(), steps = block.at("steps").get<std::vector<double>>();
  const std::size_t size = rows * bases.size();
  Eigen::MatrixXd values(rows, bases.size());
  for (std::size_t k = 0; k < bases.size(); ++k) {
    std::int32_t before = 0, before_that = 0;
    for (std::size_t t = 0; t < rows; ++t) {
      const std::size_t place = at + k * rows + t;
      const auto second = static_cast<std::uint8_t>(bytes.at(place)) | static_cast<std::uint8_t>(bytes.at(place + size))
                                                                           << 8;
      const auto value = static_cast<std::int16_t>(second + 2 * before - before_that);
      before_that = before;
      before = value;
      values(static_cast<Eigen::Index>(t), static_cast<Eigen::Index>(k)) =
          value == INT16_MIN ? NAN : bases[k] + value * steps[k];
    }
  }
  return values;
}

TEST(ReplayColumns, KeepValuesToHalfAStep) {
  Eigen::MatrixXd values(500, 3);
  for (int t = 0; t < 500; ++t) values.row(t) << std::sin(0.02 * t), 5.0, t % 2 == 0 ? -30.0 : 30.0;
  ReplayColumns columns;
  columns.add(Eigen::MatrixXd::Ones(7, 2), 0.1);  // another block before it
  const nlohmann::json block = columns.add(values, 1e-4);
  const Eigen::MatrixXd back = read_columns(columns.bytes(), block);
  EXPECT_LE((back - values).leftCols(2).cwiseAbs().maxCoeff(), 0.5e-4 * (1 + 1e-9));
  // A range of 60 at that step is more than 16 bits: the step is a 65,534th of it.
  EXPECT_LE((back - values).col(2).cwiseAbs().maxCoeff(), 60.0 / 65534 / 2 * (1 + 1e-9));
  EXPECT_THROW(columns.add(values, 0.0), std::invalid_argument);
}

TEST(ReplayColumns, WhatIsNotFiniteStaysSo) {
  Eigen::MatrixXd values(4, 2);
  values << 1.0, NAN, INFINITY, NAN, 3.0, NAN, -INFINITY, NAN;
  ReplayColumns columns;
  const nlohmann::json block = columns.add(values, 0.01);
  const Eigen::MatrixXd back = read_columns(columns.bytes(), block);
  EXPECT_DOUBLE_EQ(back(0, 0), 1.0);
  EXPECT_TRUE(std::isnan(back(1, 0)));
  EXPECT_DOUBLE_EQ(back(2, 0), 3.0);
  EXPECT_TRUE(back.col(1).array().isNaN().all());
  ReplayColumns none;
  EXPECT_EQ(none.add(Eigen::MatrixXd(0, 3), 0.01).at("rows"), 0);
  EXPECT_EQ(none.bytes(), "");
}

EpisodeRow row_of(const std::string& engine, const std::string& controller, const std::string& clip, bool success,
                  const std::string& arm = "main") {
  EpisodeRow row;
  row.engine = engine;
  row.controller = controller;
  row.policy = arm == "null" ? "null" : "dstar";
  row.arm = arm;
  row.task = "hug";
  row.clip = clip;
  row.success = success;
  row.key = engine + controller + clip + arm;
  return row;
}

std::vector<EpisodeRow> some_rows() {
  return {row_of("ode", "vmc", "a", true),         row_of("mujoco", "vmc", "a", true),
          row_of("ode", "vmc", "b", true),         row_of("mujoco", "vmc", "b", false),
          row_of("ode", "pd", "a", false),         row_of("playback", "vmc", "b", true),
          row_of("ode", "vmc", "b", false, "null")};
}

TEST(ReplayChoice, PutsTheClipWithTheLeastAgreementFirst) {
  const std::vector<EpisodeRow> rows = some_rows();
  ReplayChoice choice;
  choice.controllers = {"vmc"};
  const ChosenRows chosen = chosen_rows(rows, choice);
  ASSERT_EQ(chosen.scenes.size(), 2U);
  EXPECT_EQ(chosen.scenes[0].id, "hug/b/0/clean");
  std::vector<std::string> order;
  for (const EpisodeRow* row : chosen.scenes[0].rows) order.push_back(row->engine + " " + row->arm);
  EXPECT_THAT(order, ElementsAre("mujoco main", "ode main", "playback main", "ode null"));
  choice.scenes = 1;
  const ChosenRows fewer = chosen_rows(rows, choice);
  EXPECT_EQ(fewer.scenes.size(), 1U);
  EXPECT_THAT(fewer.notes, ElementsAre(HasSubstr("The 1 of 2 clips")));
}

TEST(ReplayChoice, TakesAClipOfEachTaskBeforeASecondOfOne) {
  std::vector<EpisodeRow> rows;
  for (const char* clip : {"a", "b"})
    for (const char* engine : {"ode", "mujoco"}) rows.push_back(row_of(engine, "vmc", clip, engine[0] == 'o'));
  for (const char* engine : {"ode", "mujoco"}) {
    rows.push_back(row_of(engine, "vmc", "w", true));
    rows.back().task = "wave";
  }
  ReplayChoice choice;
  choice.scenes = 2;
  const ChosenRows chosen = chosen_rows(rows, choice);
  ASSERT_EQ(chosen.scenes.size(), 2U);
  EXPECT_EQ(chosen.scenes[0].id, "hug/a/0/clean");
  EXPECT_EQ(chosen.scenes[1].id, "wave/w/0/clean");  // agrees, and is of another task
}

TEST(ReplayChoice, TakesTheBestControllerWhereNoneIsNamed) {
  const std::vector<EpisodeRow> rows = some_rows();
  const ChosenRows chosen = chosen_rows(rows, {});
  EXPECT_THAT(chosen.notes, ElementsAre(HasSubstr("Controller vmc alone")));
  for (const ChosenScene& scene : chosen.scenes)
    for (const EpisodeRow* row : scene.rows) EXPECT_EQ(row->controller, "vmc");
}

TEST(ReplayChoice, FindsEpisodesByTheBeginningOfAKeyOrByTheirPlace) {
  const std::vector<EpisodeRow> rows = some_rows();
  ReplayChoice choice;
  choice.episodes = {"odepd"};
  const ChosenRows by_key = chosen_rows(rows, choice);
  ASSERT_EQ(by_key.scenes.size(), 1U);
  EXPECT_THAT(by_key.scenes[0].rows, ElementsAre(&rows[4]));
  choice.episodes = {"hug/a"};
  EXPECT_EQ(chosen_rows(rows, choice).scenes.at(0).rows.size(), 3U);
}

TEST(ReplayChoice, NamesWhatItDoesNotKnow) {
  const std::vector<EpisodeRow> rows = some_rows();
  const auto refused = [&](auto change) {
    ReplayChoice choice;
    change(choice);
    return thrown_message<std::invalid_argument>([&] { chosen_rows(rows, choice); });
  };
  EXPECT_THAT(refused([](ReplayChoice& c) { c.engines = {"mujocco"}; }),
              HasSubstr("unknown engine 'mujocco': did you mean 'mujoco'?"));
  EXPECT_THAT(refused([](ReplayChoice& c) { c.episodes = {"nothing"}; }),
              HasSubstr("no episode begins with 'nothing': expected the beginning of a key, or task/clip/episode"));
  EXPECT_THAT(refused([](ReplayChoice& c) { c.engines = {"mujoco"}, c.controllers = {"pd"}; }),
              HasSubstr("no episode of the run is what"));
}

Suite archive_inputs(const std::string& record) {
  return parse_suite(
      "schema: duet.suite/1\nname: seen\nversion: 1.0.0\nclips: {synth: {per_task: 1}}\ntasks: [hug]\n"
      "engines: [playback]\ncontrollers: [pd]\npolicies: [replay]\nstart: clip\n"
      "record: {trajectories: " +
          record + "}\n",
      "seen.yaml");
}

using DuetRun = Run;  // testing::Test has one of its own

class Replay : public testing::Test {
 protected:
  DuetRun run(const std::string& record) {
    test::make_run(archive_inputs(record), folder_ / record);
    return load_run(folder_ / record);
  }
  ReplayContent content(const DuetRun& run, const ReplayChoice& choice = {}) {
    Progress quiet(Progress::Style::kQuiet);
    return replay_of_run(run, choice, quiet);
  }
  test::ScratchFolder folder_;
};

TEST_F(Replay, ReadsWhatTheRunKeptAndRunsTheRestAgainBitForBit) {
  const ReplayContent kept = content(run("all")), again = content(run("none"));
  ASSERT_EQ(kept.scenes.size(), 1U);
  ASSERT_EQ(kept.scenes[0].tracks.size(), 2U);  // replay and the null arm
  EXPECT_EQ(kept.scenes[0].tracks[0].origin, "kept by the run");
  EXPECT_EQ(again.scenes[0].tracks[0].origin, "run again: the same states, bit for bit");
  ReplayColumns columns;
  EXPECT_EQ(replay_header(again, columns).at("robots").size(), 1U);  // shared by both tracks
  const Recording &a = kept.scenes[0].tracks[0].recording, &b = again.scenes[0].tracks[0].recording;
  ASSERT_EQ(a.frames(), b.frames());
  for (int t = 0; t < a.frames(); ++t) EXPECT_EQ(a.robot[t].q, b.robot[t].q);
}

TEST_F(Replay, SaysWhereAnEpisodeThatRunsAgainIsNotWhatItWas) {
  DuetRun changed = run("none");
  for (EpisodeRow& row : changed.rows) row.state_hash = std::string(64, '0');
  EXPECT_EQ(content(changed).scenes[0].tracks[0].origin, "run again: NOT the states that the run had");
}

TEST_F(Replay, NamesTheCardThatIsMissing) {
  DuetRun other = run("all");
  for (EpisodeRow& row : other.rows) row.robot_digest = "feedbeef00";
  EXPECT_THAT(thrown_message<InputError>([&] { content(other); }),
              AllOf(HasSubstr("expected the robot card of digest feedbeef, which no card of this machine has"),
                    HasSubstr("--card names one")));
  ReplayChoice choice;
  choice.card = "g1_27dof";
  EXPECT_THAT(thrown_message<InputError>([&] { content(other, choice); }), HasSubstr("expected the 27 joints of"));
}

TEST_F(Replay, HoldsStatesToATenthOfAMillimetre) {
  const ReplayContent content_of_run = content(run("all"));
  ReplayColumns columns;
  const nlohmann::json header = replay_header(content_of_run, columns);
  const nlohmann::json& track = header.at("scenes").at(0).at("tracks").at(0);
  const Recording& recording = content_of_run.scenes[0].tracks[0].recording;
  const Eigen::MatrixXd position = read_columns(columns.bytes(), track.at("motion").at("position"));
  const Eigen::MatrixXd q = read_columns(columns.bytes(), track.at("motion").at("q"));
  ASSERT_EQ(q.rows(), recording.frames());
  for (int t = 0; t < recording.frames(); ++t) {
    EXPECT_LT((position.row(t).transpose() - recording.robot[t].X_WB.p).norm(), 1e-4);
    EXPECT_LT((q.row(t).transpose() - recording.robot[t].q).cwiseAbs().maxCoeff(), 5e-5);
  }
}

TEST_F(Replay, APageEscapesNamesAndHoldsNoAddress) {
  ReplayContent hostile = content(run("all"));
  const std::string evil = "</script><img src=x onerror=alert(1)>";
  hostile.title = hostile.scenes[0].id = hostile.scenes[0].tracks[0].name = evil;
  hostile.notes = {evil};
  const std::string html = replay_page(hostile, {"/* viewer */", "/* style */"});
  EXPECT_THAT(html, AllOf(Not(HasSubstr("<img")), HasSubstr("&lt;img src=x"), HasSubstr("/* viewer */"),
                          Not(HasSubstr("http:")), Not(HasSubstr("https:")), HasSubstr("<noscript>")));
  EXPECT_THAT(thrown_message<std::invalid_argument>([&] {
                replay_page(hostile, {"a</script>", ""});
              }),
              HasSubstr("expected no '</script' in it"));
}

TEST_F(Replay, ScenesThatAreTooLargeForOnePageAreSplit) {
  ReplayContent content_of_run = content(run("all"));
  content_of_run.scenes.resize(3, content_of_run.scenes.front());
  for (int i = 0; i < 3; ++i) content_of_run.scenes[i].id = std::to_string(i);
  const ViewerBundle viewer{"", ""};
  EXPECT_EQ(replay_pages(content_of_run, viewer).size(), 1U);
  const std::vector<ReplayPage> pages = replay_pages(content_of_run, viewer, 1000);
  ASSERT_EQ(pages.size(), 3U);
  EXPECT_THAT(pages[2].scenes, ElementsAre("2"));
}

TEST_F(Replay, TheVerdictOfATraceEndsAsTheRowsDoes) {
  const ReplayContent content_of_run = content(run("all"));
  const ReplayTrack& track = content_of_run.scenes[0].tracks[0];
  const DetectorTrace trace =
      detector_trace(track.recording, *track.robot, DetectorVersion::kRobot, ThresholdSet::kPaper, {}, 5);
  ASSERT_FALSE(trace.frames.empty());
  EXPECT_EQ(trace.frames.back(), track.recording.frames() - 1);
  EXPECT_EQ(trace.success.back(), track.kept->row.success.value());
  EXPECT_EQ(std::ssize(trace.evidence), track.recording.frames());
  Recording alone = track.recording;
  alone.partner = {};
  EXPECT_TRUE(detector_trace(alone, *track.robot, DetectorVersion::kRobot, ThresholdSet::kPaper, {}, 5).frames.empty());
  Recording diverged = track.recording;
  diverged.robot[3].q[2] = NAN;
  EXPECT_TRUE(
      detector_trace(diverged, *track.robot, DetectorVersion::kRobot, ThresholdSet::kPaper, {}, 5).frames.empty());
}

TEST_F(Replay, OfTheRuleInteractionTheActIsTraced) {
  ReplayContent judged = content(run("all"));
  for (ReplayTrack& track : judged.scenes[0].tracks) {
    ASSERT_TRUE(track.kept);
    track.kept->rules.detector = DetectorVersion::kInteraction;
  }
  const std::string data = replay_data(judged);
  EXPECT_THAT(data, HasSubstr(R"("set":"act")"));
  EXPECT_THAT(data, HasSubstr(R"("set":"paper")"));
}

TEST_F(Replay, AFullDiskLeavesTheOldMcapAndNoHalfOne) {
  const ReplayContent content_of_run = content(run("all"));
  const std::string path = folder_ / "films/replay.mcap";
  write_file(path, "old");
  {
    const test::FileSizeLimit full(2000);
    EXPECT_EQ(test::thrown_message<StorageError>([&] { write_replay_mcap(content_of_run, path); }),
              "cannot write '" + path + "': File too large");
  }
  EXPECT_EQ(read_file(path), "old");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder_ / "films"), {}), 1);
  std::filesystem::create_directory(folder_ / "films/folder");
  EXPECT_THAT(test::thrown_message<StorageError>([&] { write_replay_mcap(content_of_run, folder_ / "films/folder"); }),
              HasSubstr("expected a file, found a folder, a device or a pipe"));
}

TEST_F(Replay, TheMcapTellsBodiesOnceAndWhereTheyAreAtEachFrame) {
  const ReplayContent content_of_run = content(run("all"));
  write_replay_mcap(content_of_run, folder_ / "replay.mcap");
  write_replay_mcap(content_of_run, folder_ / "replay.mcap");  // again: replaces it
  const std::string bytes = read_file(folder_ / "replay.mcap");
  const ReplayTrack& track = content_of_run.scenes[0].tracks[0];
  const std::string topic = "/" + content_of_run.scenes[0].id + "/" + track.name;
  std::map<std::string, int> messages;
  std::set<std::string> placed;
  std::set<double> diameters, expected;
  for (const RobotShape& shape : track.robot->shapes) expected.insert(std::round(2e5 * shape.radius) / 1e5);
  Kinematics kinematics(*track.robot);
  const McapFile file = read_mcap(
      std::as_bytes(std::span(bytes)), "replay.mcap", [&](const McapChannel& channel, const McapMessage& message) {
        ++messages[channel.topic];
        const std::string text(reinterpret_cast<const char*>(message.data.data()), message.data.size());
        const nlohmann::json content = parse_json(text, channel.topic);
        if (channel.topic == topic + "/robot")
          for (const nlohmann::json& entity : content.at("entities"))
            for (const nlohmann::json& sphere : entity.at("spheres"))
              diameters.insert(sphere.at("size").at("x").get<double>());
        if (channel.topic != topic + "/where") return;
        const nlohmann::json& transforms = content.at("transforms");
        const RobotState& state = track.recording.robot[message.sequence];
        kinematics.update(state.X_WB, state.q);
        const auto last = static_cast<int>(track.robot->links.size()) - 1;
        EXPECT_NEAR(transforms.back().at("translation").at("z").get<double>(), kinematics.p_WL(last).z(), 1e-5);
        for (const nlohmann::json& transform : transforms) placed.insert(transform.at("child_frame_id"));
      });
  EXPECT_TRUE(file.whole);
  EXPECT_EQ(file.channels.size(), 2U + 2U * 4U);  // the partner of both, and each track's
  EXPECT_EQ(placed.size(), track.robot->links.size());
  EXPECT_EQ(diameters, expected);
  EXPECT_EQ(messages.at(topic + "/robot"), 1);
  EXPECT_EQ(messages.at(topic + "/where"), (track.recording.frames() + 1) / 2);
  EXPECT_EQ(messages.at(topic + "/state"), (track.recording.frames() + 1) / 2);
  EXPECT_EQ(messages.at("/" + content_of_run.scenes[0].id + "/partner"), 1);
  EXPECT_LT(bytes.size(), 1000U * track.recording.frames());
}

TEST_F(Replay, RecordingsOfAnybodyAreShownToo) {
  const ReplayContent of_run = content(run("all"));
  save_recording(of_run.scenes[0].tracks[0].recording, folder_ / "mine.npz");
  const ReplayContent mine = replay_of_files({folder_ / "mine.npz"}, "");
  ASSERT_EQ(mine.scenes.size(), 1U);
  EXPECT_FALSE(mine.scenes[0].tracks[0].kept.has_value());
  EXPECT_EQ(mine.scenes[0].tracks[0].name, "mine");
  EXPECT_THAT(thrown_message<InputError>([&] { replay_of_files({folder_ / "mine.npz"}, "g1_27dof"); }),
              HasSubstr("expected the 27 joints of"));
}

// Pieces of the drawn body in the world, each as spheres: hulls, the shapes outside of them, bars.
std::vector<std::vector<OutlineSphere>> drawn_pieces(const RobotModel& robot, const RobotState& state) {
  Kinematics kinematics(robot);
  kinematics.update(state.X_WB, state.q);
  const auto placed = [&](int link, const Eigen::Vector3d& p, double radius) {
    return OutlineSphere{kinematics.X_WL(link) * p, radius};
  };
  const RobotOutline outline = robot_outline(robot);
  std::vector<std::vector<OutlineSphere>> pieces;
  std::set<int> inside;
  for (const OutlineHull& hull : outline.hulls) {
    inside.insert(hull.shapes.begin(), hull.shapes.end());
    pieces.emplace_back();
    for (const OutlineSphere& one : hull.spheres) pieces.back().push_back(placed(hull.link, one.center, one.radius));
  }
  for (int i = 0; i < static_cast<int>(robot.shapes.size()); ++i) {
    if (inside.contains(i)) continue;
    const RobotShape& shape = robot.shapes[i];
    pieces.emplace_back();
    for (const double z : {-shape.half_length, 0.0, shape.half_length})
      pieces.back().push_back(placed(shape.link, shape.X_LS * Eigen::Vector3d(0.0, 0.0, z), shape.radius));
  }
  for (const OutlineBar& bar : outline.bars)
    pieces.push_back({placed(bar.from_link, bar.from, bar.radius), placed(bar.to_link, bar.to, bar.radius)});
  return pieces;
}

bool touch(const std::vector<OutlineSphere>& a, const std::vector<OutlineSphere>& b) {
  for (const OutlineSphere& one : a)
    for (const OutlineSphere& other : b)
      if ((one.center - other.center).norm() < one.radius + other.radius) return true;
  return false;
}

// How many pieces hang together with the first one.
std::size_t in_one_piece(const std::vector<std::vector<OutlineSphere>>& pieces) {
  std::set<std::size_t> reached = {0}, open = {0};
  while (!open.empty()) {
    const std::size_t here = *open.begin();
    open.erase(open.begin());
    for (std::size_t other = 0; other < pieces.size(); ++other)
      if (!reached.contains(other) && touch(pieces[here], pieces[other])) reached.insert(other), open.insert(other);
  }
  return reached.size();
}

TEST(RobotOutline, IsOnePieceThatStandsOnItsSoles) {
  for (const RobotCardFile& card : robot_cards()) {
    const auto robot = load_shared_robot(card.name);
    const std::vector<std::vector<OutlineSphere>> pieces = drawn_pieces(*robot, robot->standing_state());
    ASSERT_FALSE(pieces.empty()) << card.name;
    EXPECT_EQ(in_one_piece(pieces), pieces.size()) << card.name;
    double lowest = 1.0;
    for (const auto& piece : pieces)
      for (const OutlineSphere& one : piece) lowest = std::min(lowest, one.center.z() - one.radius);
    EXPECT_NEAR(lowest, 0.0, 1e-6) << card.name;  // standing_state puts the soles on the ground
    const RobotOutline outline = robot_outline(*robot);
    EXPECT_EQ(std::ranges::count(outline.hulls, true, &OutlineHull::is_foot), 2) << card.name;
    EXPECT_GE(std::ranges::count(outline.hulls, false, &OutlineHull::is_foot), 1) << card.name;
  }
}

TEST(RobotOutline, StaysOnePieceHoweverTheJointsAreBent) {
  const auto robot = load_shared_robot("");
  RobotState state = robot->standing_state();
  for (const double part : {0.1, 0.5, 0.9}) {
    state.q = robot->lower() + part * (robot->upper() - robot->lower());
    const auto pieces = drawn_pieces(*robot, state);
    EXPECT_EQ(in_one_piece(pieces), pieces.size()) << part;
  }
}

TEST(RobotOutline, IsEmptyForARobotWithoutShapes) {
  RobotModel bare = *load_shared_robot("");
  bare.shapes.clear();
  bare.feet.clear();
  EXPECT_TRUE(robot_outline(bare).hulls.empty());
  EXPECT_TRUE(robot_outline(bare).bars.empty());
}

class ReplayOfMotions : public testing::Test {
 protected:
  ReplayOfMotions() {
    save_clip(clip_, folder_ / "clip.npz");
    save_paired_motion(retarget(clip_, *load_shared_robot(""), {}), folder_ / "paired.npz");
  }
  test::ScratchFolder folder_;
  InteractionClip clip_ = synthesize(Task::kHug, {});
};

TEST_F(ReplayOfMotions, AClipIsItsTwoPeople) {
  const ReplayContent content = replay_of_files({folder_ / "clip.npz"}, "");
  ASSERT_EQ(content.scenes.size(), 1U);
  const ReplayTrack& track = content.scenes[0].tracks.at(0);
  EXPECT_EQ(content.scenes[0].task, "hug");
  EXPECT_EQ(track.robot, nullptr);
  EXPECT_EQ(track.frames(), clip_.frames());
  EXPECT_EQ(track.recording.partner, clip_.actor_motion().joints);
  EXPECT_EQ(track.other_person, clip_.reactor_motion().joints);
  ReplayColumns columns;
  const nlohmann::json header = replay_header(content, columns);
  EXPECT_TRUE(header.at("robots").empty());
  EXPECT_EQ(header.at("partners").size(), 2U);
  EXPECT_EQ(header.at("scenes").at(0).at("tracks").at(0).at("robot"), -1);
}

TEST_F(ReplayOfMotions, APairedMotionIsTheRobotBesideTheAdaptedPartnerAndThePeopleThatItCameFrom) {
  const PairedMotion motion = load_paired_motion(folder_ / "paired.npz");
  const ReplayContent content = replay_of_files({folder_ / "paired.npz"}, "");
  const std::vector<ReplayTrack>& tracks = content.scenes.at(0).tracks;
  ASSERT_EQ(tracks.size(), 2U);
  EXPECT_EQ(tracks[0].recording.partner, motion.partner.joints);
  EXPECT_EQ(tracks[0].recording.robot.at(9).q, Eigen::VectorXd(motion.robot.q.col(9)));
  EXPECT_EQ(tracks[1].recording.partner, motion.source_partner.joints);
  EXPECT_EQ(tracks[1].other_person, motion.source_reactor.joints);
  ReplayColumns columns;
  const nlohmann::json header = replay_header(content, columns), scene = header.at("scenes").at(0);
  EXPECT_EQ(header.at("partners").size(), 3U);
  EXPECT_FALSE(scene.at("tracks").at(0).at("detectors").empty());
  EXPECT_THAT(thrown_message<InputError>([&] { replay_of_files({folder_ / "paired.npz"}, "t1"); }),
              AllOf(HasSubstr("paired.npz"), HasSubstr("its joints are not those of 't1'")));
  EXPECT_EQ(replay_of_files({folder_ / "paired.npz", folder_ / "clip.npz"}, "").scenes.size(), 2U);
  EXPECT_THAT(thrown_message<InputError>([&] {
                replay_of_files({folder_ / "clip.npz", folder_ / "clip.npz"}, "");
              }),
              AllOf(HasSubstr("clip.npz"), HasSubstr("/people' is among the files already")));
}

TEST_F(ReplayOfMotions, TheCommandTakesFilesAndFolders) {
  const test::Answer page = test::duet_program("replay " + (folder_ / "paired.npz") + " -o " + (folder_ / "p.mcap"));
  EXPECT_EQ(page.code, 0) << page.err;
  EXPECT_TRUE(std::filesystem::exists(folder_ / "p.mcap"));
  std::filesystem::create_directory(folder_ / "motions");
  std::filesystem::copy(folder_ / "clip.npz", folder_ / "motions");
  const test::Answer folder = test::duet_program("replay " + (folder_ / "motions") + " -o " + (folder_ / "m.mcap"));
  EXPECT_EQ(folder.code, 0) << folder.err;
  EXPECT_THAT(folder.out, HasSubstr("1 clip)"));
  const test::Answer without = test::duet_program("replay " + (folder_ / "clip.npz") + " -o " + (folder_ / "rep"));
  EXPECT_EQ(without.code, 2);
  EXPECT_THAT(without.err, AllOf(HasSubstr("expected a name that ends in .html or .mcap"), HasSubstr("/rep'")));
}

TEST_F(Replay, TheFolderOfARunIsNamed) {
  std::filesystem::create_directory(folder_ / "demo");
  test::make_run(archive_inputs("all"), folder_ / "demo/run");
  const test::Answer answer = test::duet_program("replay " + (folder_ / "demo") + " -f mcap");
  EXPECT_EQ(answer.code, 2);
  EXPECT_THAT(answer.err, HasSubstr("is not a run directory (no run.json); '" + (folder_ / "demo/run") + "' is one"));
}

TEST_F(Replay, TheCommandSaysWhatItCannotRead) {
  write_file(folder_ / "other.npz", "no archive");
  const test::Answer broken = test::duet_program("replay " + (folder_ / "other.npz") + " -o " + (folder_ / "a.mcap"));
  EXPECT_EQ(broken.code, 2);
  EXPECT_THAT(broken.err, HasSubstr("other.npz"));
  const test::Answer format = test::duet_program("replay " + (folder_ / "other.npz") + " -f htm");
  EXPECT_EQ(format.code, 2);
  EXPECT_THAT(format.err, HasSubstr("unknown format 'htm': did you mean 'html'?"));
  const test::Answer absent = test::duet_program("replay " + (folder_ / "nowhere") + " -f mcap");
  EXPECT_EQ(absent.code, 2);
  EXPECT_THAT(absent.err, HasSubstr("nowhere"));
}

}  // namespace
}  // namespace duet
