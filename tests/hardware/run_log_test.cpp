#include "duet/hardware/log/run_log.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <thread>
#include <vector>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/hardware/log/frame_cdr.h"
#include "duet/hardware/log/limiter_replay.h"
#include "duet/hardware/log/log_reader.h"
#include "duet/hardware/log/run_report.h"
#include "tests/backends/allocation_count.h"
#include "tests/hardware/logged_twin.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::GuardedTwin;
using ::testing::HasSubstr;

std::span<const std::byte> bytes_of(const std::string& text) { return std::as_bytes(std::span(text)); }

// A file of five messages that is no log.
std::string small_file(const test::ScratchFolder& folder) {
  {
    McapWriter writer(folder / "small.mcap");
    writer.add({1, "first", "json", "", "", ""});
    for (int k = 0; k < 5; ++k) writer.write(1, k, k, bytes_of("abcdef"));
  }
  return read_file(folder / "small.mcap");
}

// A run with arms, walking, a planner that comes back and the operator's stop.
void run_and_log(const std::string& path, const GuardSetup& setup) {
  test::LoggedTwin run(path, setup, {.place_noise = 0.001, .joint_noise = 1e-4});
  GuardedTwin& robot = run.robot;
  run.arm();
  robot.message.command.root.forward = 0.3;
  robot.message.command.q.array() += 0.5;
  run.run_for(2.0);
  robot.plans = false;
  run.run_for(0.8);
  robot.plans = true;
  run.run_for(0.3);
  robot.hold_key(RemoteKey::kSelect);
  run.run_for(0.2);
  EXPECT_EQ(run.log.dropped(), 0);
  EXPECT_TRUE(run.log.good());
}

void expect_same_bits(const GuardSetup& setup) {
  const test::ScratchFolder folder;
  run_and_log(folder / "run.mcap", setup);
  const LogReplay replay = replay_log(folder / "run.mcap");
  EXPECT_GT(replay.ticks, 2500);
  EXPECT_EQ(replay.different, 0);
  EXPECT_TRUE(replay.whole);
  std::string events;
  for (const std::string& event : replay.events) events += event;
  for (const char* state : {"listen", "ready", "armed", "stand", "run", "hold", "damp"})
    EXPECT_THAT(events, HasSubstr(state));
}

TEST(RunLog, ReplayedThroughTheLimiterGivesTheSameBits) { expect_same_bits(test::twin_guard()); }

// Reads a message by the schema that its log carries and by nothing else, as a viewer of others does: members one after
// the other, each at a multiple of its own size.
class SchemaReader {
 public:
  explicit SchemaReader(const std::string& schema) {
    const std::regex member(R"(([\w/]+?)(?:\[(\d+)\])? (\w+))");
    std::istringstream lines(schema);
    std::string of;  // the message itself
    for (std::string line; std::getline(lines, line);) {
      std::smatch m;
      if (line.starts_with("MSG: "))
        of = line.substr(5);
      else if (std::regex_match(line, m, member))
        structs_[of].push_back({m[1], m[3], m[2].matched ? std::stoi(m[2]) : 0});
    }
  }
  // The numbers by their names, "motor_cmd[18].q"; nothing where bytes are missing or left.
  std::map<std::string, double> read(std::span<const std::byte> body) {
    values_.clear();
    body_ = body;
    at_ = 0;
    read_struct("", "");
    if (at_ != body.size()) values_.clear();
    return values_;
  }

 private:
  struct Member {
    std::string type, name;
    int count;
  };
  void read_struct(const std::string& name, const std::string& prefix) {
    for (const Member& member : structs_.at(name))
      for (int k = 0; k < std::max(member.count, 1); ++k) {
        const std::string path = prefix + member.name + (member.count > 0 ? "[" + std::to_string(k) + "]" : "");
        if (member.type == "uint8")
          values_[path] = number<std::uint8_t>();
        else if (member.type == "int16")
          values_[path] = number<std::int16_t>();
        else if (member.type == "float32")
          values_[path] = static_cast<double>(number<float>());
        else if (member.type == "uint32")
          values_[path] = number<std::uint32_t>();
        else
          read_struct(member.type, path + ".");
      }
  }
  template <typename T>
  T number() {
    T value{};
    at_ = (at_ + sizeof(T) - 1) / sizeof(T) * sizeof(T);
    if (at_ + sizeof(T) <= body_.size()) std::memcpy(&value, body_.data() + at_, sizeof(T));
    at_ += sizeof(T);
    return value;
  }

  std::map<std::string, std::vector<Member>> structs_;
  std::map<std::string, double> values_;
  std::span<const std::byte> body_;
  std::size_t at_ = 0;
};

TEST(RunLog, HoldsTheFramesAsTheSchemasInItSay) {
  const test::ScratchFolder folder;
  run_and_log(folder / "run.mcap", test::twin_guard());
  long commands = 0, states = 0;
  const std::string bytes = read_file(folder / "run.mcap");
  read_mcap(bytes_of(bytes), "run.mcap", [&](const McapChannel& channel, const McapMessage& message) {
    if (channel.message_encoding != "cdr") return;
    EXPECT_EQ(channel.schema_encoding, "ros2msg");
    const bool command = channel.topic == "rt/lowcmd";
    if (++(command ? commands : states) % 250 != 1) return;
    const std::string type = command ? "/LowCmd" : "/LowState", motor = command ? "motor_cmd[" : "motor_state[";
    ASSERT_TRUE(channel.schema_name.ends_with(type));
    std::map<std::string, double> values = SchemaReader(channel.schema).read(message.data.subspan(4));
    ASSERT_FALSE(values.empty()) << "bytes are missing or left";
    LowCommandFrame sent{};
    LowStateFrame received{};
    ASSERT_TRUE(command ? read_cdr(message.data, sent) : read_cdr(message.data, received));
    EXPECT_EQ(values["crc"], command ? sent.crc : received.crc);
    EXPECT_EQ(command ? sent.crc : received.crc, command ? checksum_of(sent) : checksum_of(received));
    for (int j = 0; j < kG1Motors; ++j) {
      const std::string path = motor + std::to_string(j) + "].";
      EXPECT_EQ(values[path + "q"], static_cast<double>(command ? sent.motor[j].q : received.motor[j].q)) << path;
      EXPECT_EQ(values[path + "mode"], command ? sent.motor[j].mode : received.motor[j].mode) << path;
      if (command) {
        EXPECT_EQ(values[path + "kp"], static_cast<double>(sent.motor[j].kp)) << path;
      }
    }
  });
  EXPECT_GT(states, 2500);
  EXPECT_GT(commands, 1500);
}

TEST(FrameCdr, ReadsWhatItWroteAndRefusesTheRest) {
  LowStateFrame state{};
  auto* bytes = reinterpret_cast<unsigned char*>(&state);
  for (std::size_t k = 0; k < sizeof(state); ++k) bytes[k] = static_cast<unsigned char>(k * 7 + 1);
  LowStateFrame again;
  EXPECT_EQ(cdr_of(state).size(), 2092u);  // a head of 4 bytes, and 2088
  ASSERT_TRUE(read_cdr(cdr_of(state), again));
  EXPECT_EQ(again.imu.temperature, state.imu.temperature);
  for (int j = 0; j < kG1Motors; ++j) {
    EXPECT_EQ(again.motor[j].mode, state.motor[j].mode) << j;
    EXPECT_EQ(again.motor[j].sensor[1], state.motor[j].sensor[1]) << j;
  }
  EXPECT_EQ(again.crc, state.crc);
  LowCommandFrame command{};
  auto whole = cdr_of(command);
  EXPECT_EQ(whole.size(), 1004u);
  EXPECT_FALSE(read_cdr(std::span<const std::byte>(whole).first(1000), command));
  EXPECT_FALSE(read_cdr(whole, again));
  std::vector<std::byte> before(4 + sizeof(state));  // as logs once had it: the struct behind the head
  before[1] = std::byte{1};
  std::memcpy(before.data() + 4, &state, sizeof(state));
  ASSERT_TRUE(read_cdr(before, again));
  EXPECT_EQ(std::memcmp(&again, &state, sizeof(state)), 0);
  whole[1] = std::byte{0};  // of the other byte order
  EXPECT_FALSE(read_cdr(whole, command));
}

TEST(RunLog, BesideAPersonToo) {
  GuardSetup setup = test::twin_guard(true);
  setup.limiter.limits.arm_speed = 0.4;
  setup.limiter.touches = {{"hand", "hand"}};
  expect_same_bits(setup);
}

// The messages of a log without chunks, the first `from` of each replaced by `to`.
void write_without_checksums(const std::string& bytes, const std::string& from, const std::string& to,
                             const std::string& path) {
  McapWriter writer(path, McapChunks::kNone);
  std::set<std::uint16_t> added;
  read_mcap(bytes_of(bytes), "log", [&](const McapChannel& channel, const McapMessage& message) {
    if (added.insert(channel.id).second) writer.add(channel);
    std::string text(reinterpret_cast<const char*>(message.data.data()), message.data.size());
    if (const std::size_t at = from.empty() ? std::string::npos : text.find(from); at != std::string::npos)
      text.replace(at, from.size(), to);
    writer.write(channel.id, message.sequence, message.time, std::as_bytes(std::span(text)));
  });
}

TEST(RunLog, AnotherLimiterIsNoticed) {
  const test::ScratchFolder folder;
  run_and_log(folder / "run.mcap", test::twin_guard());
  const std::string speed = "\"arm_speed\":\"0.5\"";
  write_without_checksums(read_file(folder / "run.mcap"), speed, "\"arm_speed\":\"0.4\"", folder / "other.mcap");
  EXPECT_GT(replay_log(folder / "other.mcap").different, 0);
}

// As logs were written before: they are read as ever.
TEST(RunLog, ALogWithoutChunksIsReplayed) {
  const test::ScratchFolder folder;
  run_and_log(folder / "run.mcap", test::twin_guard());
  write_without_checksums(read_file(folder / "run.mcap"), "", "", folder / "old.mcap");
  const LogReplay replay = replay_log(folder / "old.mcap");
  EXPECT_GT(replay.ticks, 1000);
  EXPECT_EQ(replay.different, 0);
}

// A log of the time when frames were C structs, and nothing was in chunks.
TEST(RunLog, ALogOfBeforeIsReplayedAndRead) {
  const std::string old = DUET_SOURCE_DIR "/tests/fuzz/corpus/log_recording/sample0";
  const LogReplay replay = replay_log(old);
  EXPECT_EQ(replay.ticks, 12);
  EXPECT_TRUE(replay.whole);
  const LoggedRun run = recording_of_log(old);
  EXPECT_EQ(run.recording.frames(), 1);  // the planner has a goal in the last ticks alone
}

TEST(RunLog, TicksThatAreTooOldAreSaidToBe) {
  const test::ScratchFolder folder;
  {
    McapWriter writer(folder / "old.mcap");
    writer.add({1, "guard/tick", "duet.tick/1", "", "", ""});
    writer.write(1, 1, 1, bytes_of("abc"));
  }
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { (void)replay_log(folder / "old.mcap"); }));
}

// Where the content of each packed chunk lies that has its end.
std::vector<std::pair<std::size_t, std::size_t>> chunks_of(const std::string& bytes) {
  std::vector<std::pair<std::size_t, std::size_t>> chunks;
  for (std::size_t at = 8; at + 9 <= bytes.size();) {
    std::uint64_t length = 0;
    std::memcpy(&length, bytes.data() + at + 1, sizeof(length));
    if (length > bytes.size() - at - 9) break;
    if (bytes[at] == 0x06) chunks.emplace_back(at + 9, at + 9 + length);
    at += 9 + length;
  }
  return chunks;
}

TEST(RunLog, ACutLogIsCoveredByChecksumsUpToTheChunkThatWasCut) {
  const test::ScratchFolder folder;
  run_and_log(folder / "run.mcap", test::twin_guard());
  std::string bytes = read_file(folder / "run.mcap");
  const auto whole = chunks_of(bytes);
  ASSERT_GE(whole.size(), 3u);
  bytes.resize((whole[2].first + whole[2].second) / 2);
  const auto chunks = chunks_of(bytes);
  ASSERT_EQ(chunks.size(), 2u);
  write_file(folder / "cut.mcap", bytes);
  const LogReplay cut = replay_log(folder / "cut.mcap");
  constexpr int kFlips = 30;
  int refused = 0;
  for (const auto& [begin, end] : chunks)
    for (int i = 0; i < kFlips; ++i) {
      std::string flipped = bytes;
      const std::size_t at = begin + 16 + (end - begin - 17) * i / (kFlips - 1);  // behind its times
      flipped[at] = static_cast<char>(flipped[at] ^ 0x10);
      write_file(folder / "flipped.mcap", flipped);
      try {
        const LogReplay replay = replay_log(folder / "flipped.mcap");  // zstd's frames have bits that say nothing
        EXPECT_TRUE(replay.ticks == cut.ticks && replay.different == 0) << at;
      } catch (const InputError&) {
        ++refused;
      }
    }
  EXPECT_GE(refused, 2 * kFlips - 2);
}

TEST(RunLog, ALogThatIsCutAnywhereIsReplayedAsFarAsItGoes) {
  const test::ScratchFolder folder;
  run_and_log(folder / "run.mcap", test::twin_guard());
  const std::string bytes = read_file(folder / "run.mcap");
  const std::size_t begins = chunks_of(bytes).front().first;
  constexpr int kCuts = 12;
  long before = 0, inside = 0;
  for (int i = 1; i < kCuts; ++i) {
    write_file(folder / "cut.mcap", bytes.substr(0, begins + (bytes.size() - begins) * i / kCuts));
    const LogReplay replay = replay_log(folder / "cut.mcap");
    EXPECT_EQ(replay.different, 0) << i;
    EXPECT_FALSE(replay.whole) << i;
    EXPECT_GE(replay.ticks, before) << i;
    inside += replay.ticks > before ? 1 : 0;
    before = replay.ticks;
  }
  EXPECT_GE(inside, kCuts - 3);  // no chunk is lost whole
  EXPECT_GT(before, 2000);
}

// The file that a guard that is killed now would leave: all but the ticks that the writer has not come to.
TEST(RunLog, ALogInWorkHasEveryTickThatWasWritten) {
  const test::ScratchFolder folder;
  GuardedTwin robot;
  RunLog log(folder / "run.mcap", test::twin_guard());
  for (int k = 0; k < 100; ++k) {
    robot.tick();
    log.add(robot.guard);
  }
  long ticks = 0;
  for (int tries = 0; tries < 200 && ticks < 100; ++tries) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));  // the writer's turn
    try {
      ticks = replay_log(folder / "run.mcap").ticks;
    } catch (const InputError&) {  // not yet begun
    }
  }
  EXPECT_EQ(ticks, 100);
  EXPECT_FALSE(replay_log(folder / "run.mcap").whole);
}

// Fifty times a second, with a member for each that the schema promises.
TEST(RunLog, HealthAndLimiterArePlainJsonAsTheirSchemasSay) {
  const test::ScratchFolder folder;
  run_and_log(folder / "run.mcap", test::twin_guard());
  std::map<std::string, long> counts;
  const std::string bytes = read_file(folder / "run.mcap");
  read_mcap(bytes_of(bytes), "run.mcap", [&](const McapChannel& channel, const McapMessage& message) {
    ++counts[channel.topic];
    if (channel.topic != "guard/health" && channel.topic != "guard/limiter") return;
    EXPECT_EQ(channel.message_encoding, "json");
    EXPECT_EQ(channel.schema_encoding, "jsonschema");
    const nlohmann::json schema = nlohmann::json::parse(channel.schema);
    const nlohmann::json json =
        nlohmann::json::parse(std::string(reinterpret_cast<const char*>(message.data.data()), message.data.size()));
    EXPECT_EQ(schema["title"], channel.schema_name);
    EXPECT_EQ(json_schema_of(json, channel.schema_name), schema);
    EXPECT_NEAR(json["time"].get<double>(), 1e-9 * static_cast<double>(message.time), 1e-6);
  });
  EXPECT_EQ(counts["guard/setup"], 1);
  EXPECT_EQ(counts["guard/health"], (counts["guard/tick"] + 9) / 10);
  EXPECT_EQ(counts["guard/limiter"], counts["guard/health"]);
}

// Two kinds of refusals in the first second, one more later: an event for each reason and second.
TEST(RunLog, RefusedEstimatesAreSaidWithTheirReason) {
  const test::ScratchFolder folder;
  {
    GuardedTwin robot(test::twin_guard(), {});
    RunLog log(folder / "run.mcap", test::twin_guard());
    for (int tick = 0; tick < 1500; ++tick) {
      if (tick == 100 || tick == 1400) robot.guard.note_estimate(PersonFault::kFar);
      if (tick == 100) robot.guard.note_estimate(PersonFault::kBody);
      if (tick == 100) robot.guard.note_estimate(PersonFault::kUnseen);
      robot.tick();
      log.add(robot.guard);
    }
  }
  std::vector<std::string> said;
  LogParts parts;
  parts.event = [&](const LogEvent& event) {
    if (event.refused > 0) said.push_back(event.why + " " + std::to_string(event.refused));
  };
  EXPECT_TRUE(read_run_log(folder / "run.mcap", parts));
  EXPECT_THAT(said, testing::ElementsAre("far 1", "body 1", "far 1"));
  const RunReport report = report_of_log(folder / "run.mcap");
  const auto fault = std::ranges::find(report.faults, "estimates refused: far", &RunReport::Fault::name);
  ASSERT_NE(fault, report.faults.end());
  EXPECT_EQ(fault->count, 2);
}

TEST(RunLog, DatagramsThatWereRefusedAreSaidWithTheirReason) {
  const test::ScratchFolder folder;
  {
    GuardedTwin robot(test::twin_guard(), {});
    RunLog log(folder / "run.mcap", test::twin_guard());
    NetworkCounts counts{};
    for (int tick = 0; tick < 600; ++tick) {
      ++counts[0];
      if (tick == 100) counts[static_cast<std::size_t>(SealRefusal::kForged)] = 40;
      if (tick == 100) counts[static_cast<std::size_t>(SealRefusal::kLate)] = 1;
      robot.guard.note_network(counts);
      robot.tick();
      log.add(robot.guard);
    }
  }
  std::vector<std::string> said;
  NetworkCounts last{};
  LogParts parts;
  parts.event = [&](const LogEvent& event) {
    if (event.kept_out > 0) said.push_back(event.why + " " + std::to_string(event.kept_out));
  };
  parts.health = [&](const HealthMessage& message) { last = message.health.network; };
  EXPECT_TRUE(read_run_log(folder / "run.mcap", parts));
  EXPECT_THAT(said, testing::ElementsAre("forged 40", "late 1"));
  EXPECT_EQ(last[static_cast<std::size_t>(SealRefusal::kForged)], 40);
  EXPECT_GT(last[0], 580);
  const RunReport report = report_of_log(folder / "run.mcap");
  const auto fault = std::ranges::find(report.faults, "from the network, refused: forged", &RunReport::Fault::name);
  ASSERT_NE(fault, report.faults.end());
  EXPECT_EQ(fault->count, 40);
}

// A ring that is full while the writer sleeps: the log says where ticks are missing, and how many.
TEST(RunLog, TicksThatFoundNoRoomAreSaidInTheLog) {
  const test::ScratchFolder folder;
  long dropped = 0;
  {
    GuardedTwin robot(test::twin_guard(), {});
    RunLog log(folder / "run.mcap", test::twin_guard());
    robot.tick();
    constexpr long kMost = 5'000'000;
    for (long added = 0; added < kMost && log.dropped() < 100; ++added) log.add(robot.guard);
    std::this_thread::sleep_for(std::chrono::milliseconds(200));  // the writer's turn
    log.add(robot.guard);
    dropped = log.dropped();
  }
  ASSERT_GE(dropped, 100);
  const LogReplay replay = replay_log(folder / "run.mcap");
  EXPECT_EQ(replay.dropped, dropped);
  EXPECT_TRUE(replay.whole);
}

TEST(RunLog, RefusesWhatIsNoLogOfARun) {
  const test::ScratchFolder folder;
  (void)small_file(folder);
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { (void)replay_log(folder / "small.mcap"); }));
  write_file(folder / "text", "text");
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { (void)replay_log(folder / "text"); }));
}

TEST(RunLog, ATickIsAddedWithoutAllocation) {
  if (!test::allocations_are_counted()) GTEST_SKIP() << "not run: the sanitizer has a malloc of its own";
  const test::ScratchFolder folder;
  GuardedTwin robot;
  RunLog log(folder / "run.mcap", test::twin_guard());
  robot.start();
  const long before = test::allocation_count();
  log.add(robot.guard);
  EXPECT_EQ(test::allocation_count(), before);
}

}  // namespace
}  // namespace duet
