#include "duet/hardware/log/run_log.h"

#include <gmock/gmock.h>

#include <cstring>
#include <map>
#include <regex>
#include <set>
#include <vector>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/hardware/log/frame_cdr.h"
#include "tests/backends/allocation_count.h"
#include "tests/hardware/guarded_twin.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::GuardedTwin;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::span<const std::byte> bytes_of(const std::string& text) { return std::as_bytes(std::span(text)); }

TEST(Mcap, WhatIsWrittenIsRead) {
  const test::ScratchFolder folder;
  {
    McapWriter writer(folder / "a.mcap");
    writer.add({1, "first", "json", "", "", ""});
    writer.add({2, "second", "cdr", "Type", "omgidl", "struct Type {};"});
    EXPECT_TRUE(writer.write(2, 7, 1234567890123, bytes_of("abc")));
    EXPECT_TRUE(writer.write(1, 8, 5, bytes_of("")));
  }
  std::vector<std::string> found;
  const std::string bytes = read_file(folder / "a.mcap");
  const McapFile file = read_mcap(bytes_of(bytes), "a.mcap", [&](const McapChannel& c, const McapMessage& m) {
    found.push_back(c.topic + c.schema_name + std::to_string(m.sequence) + "@" + std::to_string(m.time) + ":" +
                    std::string(reinterpret_cast<const char*>(m.data.data()), m.data.size()));
  });
  EXPECT_THAT(found, ElementsAre("secondType7@1234567890123:abc", "first8@5:"));
  EXPECT_TRUE(file.whole);
  EXPECT_EQ(file.messages, 2);
}

std::vector<std::string> messages_of(const std::string& bytes) {
  std::vector<std::string> found;
  read_mcap(bytes_of(bytes), "a.mcap", [&](const McapChannel& c, const McapMessage& m) {
    found.push_back(c.topic + std::to_string(m.sequence) + std::to_string(m.data.size()));
  });
  return found;
}

std::string chunked_file(const std::string& path) {
  const std::string long_text(3'000'000, 'x');
  {
    McapWriter writer(path, McapChunks::kZstd);
    writer.add({1, "first", "json", "Type", "jsonschema", "{}"});
    writer.write(1, 1, 10, bytes_of(long_text));
    writer.write(1, 2, 20, bytes_of(long_text));  // a chunk is full
    writer.add({2, "second", "json", "", "", ""});
    writer.write(2, 3, 30, bytes_of("abc"));
  }
  return read_file(path);
}

TEST(Mcap, ChunksAreSmallAndHoldTheSame) {
  const test::ScratchFolder folder;
  const std::string bytes = chunked_file(folder / "a.mcap");
  EXPECT_LT(bytes.size(), 10'000U);
  EXPECT_THAT(messages_of(bytes), ElementsAre("first13000000", "first23000000", "second33"));
  const std::size_t second = bytes.find("zstd", bytes.find("zstd") + 1);
  ASSERT_NE(second, std::string::npos);
  EXPECT_THAT(messages_of(bytes.substr(0, second)), ElementsAre("first13000000", "first23000000"));
}

TEST(Mcap, AChunkThatCannotBeUnpackedIsNamed) {
  const test::ScratchFolder folder;
  const std::string bytes = chunked_file(folder / "a.mcap");
  const auto refusal = [](const std::string& file) {
    return test::thrown_message<InputError>([&] { static_cast<void>(messages_of(file)); });
  };
  const std::size_t name = bytes.find("zstd");
  std::string other = bytes;
  other.replace(name, 4, "lzma");
  EXPECT_SENTENCE(refusal(other));
  std::string huge = bytes;
  huge.replace(name - 16, 8, std::string(8, '\x7f'));  // what it says to unpack to
  EXPECT_SENTENCE(refusal(huge));
  std::string broken = bytes;
  broken.replace(name + 12, 4, "junk");  // of the packed bytes
  EXPECT_SENTENCE(refusal(broken));
  std::string sum = bytes;
  sum[name - 8] = static_cast<char>(sum[name - 8] + 1);
  EXPECT_SENTENCE(refusal(sum));
}

// The bytes that the format's specification prescribes, for its smallest file: magic, header, end of data, footer,
// magic.
TEST(Mcap, TheSmallestFileHasTheBytesOfTheSpecification) {
  const test::ScratchFolder folder;
  { McapWriter writer(folder / "a.mcap"); }
  const std::string bytes = read_file(folder / "a.mcap");
  const std::string magic("\x89MCAP0\r\n", 8);
  ASSERT_EQ(bytes.size(), 8u + (9 + 4 + 8) + (9 + 4) + (9 + 20) + 8);
  EXPECT_EQ(bytes.substr(0, 8), magic);
  EXPECT_EQ(bytes.substr(bytes.size() - 8), magic);
  EXPECT_EQ(bytes.substr(8, 13), std::string("\x01\x0c\0\0\0\0\0\0\0\0\0\0\0", 13));
  EXPECT_EQ(bytes.substr(29, 9), std::string("\x0f\x04\0\0\0\0\0\0\0", 9));
  EXPECT_EQ(bytes.substr(42, 9), std::string("\x02\x14\0\0\0\0\0\0\0", 9));
}

TEST(Mcap, AFileIsNotMadeTwice) {
  const test::ScratchFolder folder;
  { McapWriter writer(folder / "a.mcap"); }
  EXPECT_SENTENCE(test::thrown_message<StorageError>([&] { McapWriter writer(folder / "a.mcap"); }));
}

std::string small_file(const test::ScratchFolder& folder) {
  {
    McapWriter writer(folder / "small.mcap");
    writer.add({1, "first", "json", "", "", ""});
    for (int k = 0; k < 5; ++k) writer.write(1, k, k, bytes_of("abcdef"));
  }
  return read_file(folder / "small.mcap");
}

TEST(Mcap, AFileOfAKilledWriterIsReadToItsLastRecord) {
  const test::ScratchFolder folder;
  const std::string bytes = small_file(folder);
  long before = 0;
  for (std::size_t length = 8; length < bytes.size(); ++length) {
    const McapFile file =
        read_mcap(bytes_of(bytes).first(length), "cut", [](const McapChannel&, const McapMessage&) {});
    EXPECT_GE(file.messages, before) << length;
    before = file.messages;
  }
  EXPECT_EQ(before, 5);
}

TEST(Mcap, RefusesWhatIsDamaged) {
  const test::ScratchFolder folder;
  const std::string good = small_file(folder);
  const auto refusal = [](const std::string& bytes) {
    return test::thrown_message<InputError>(
        [&] { read_mcap(bytes_of(bytes), "x.mcap", [](const McapChannel&, const McapMessage&) {}); });
  };
  EXPECT_SENTENCE(refusal("not an mcap file at all"));
  std::string bad = good;
  bad[good.find("abcdef")] ^= 1;
  EXPECT_SENTENCE(refusal(bad));
  bad = good;
  bad[good.find("abcdef") - 22] = 9;
  EXPECT_SENTENCE(refusal(bad));
}

// A run with arms, walking, a planner that comes back and the operator's stop.
void run_and_log(const std::string& path, const GuardSetup& setup) {
  GuardedTwin robot(setup, {.place_noise = 0.001, .joint_noise = 1e-4});
  RunLog log(path, setup);
  const auto run_for = [&](double seconds) {
    for (double left = seconds; left > 0.5 * GuardedTwin::kDt; left -= GuardedTwin::kDt) {
      robot.tick();
      log.add(robot.guard);
      if (robot.ticks % 500 == 0) std::this_thread::sleep_for(std::chrono::milliseconds(30));  // the writer's turn
    }
  };
  robot.hold_key(RemoteKey::kR1);
  run_for(2.2);
  robot.guard.arm();
  run_for(0.01);
  robot.hold_key(RemoteKey::kStart);
  run_for(0.1);
  robot.drop_key(RemoteKey::kStart);
  robot.hold_key(RemoteKey::kA);
  robot.message.command.root.forward = 0.3;
  robot.message.command.q.array() += 0.5;
  run_for(2.0);
  robot.plans = false;
  run_for(0.8);
  robot.plans = true;
  run_for(0.3);
  robot.hold_key(RemoteKey::kSelect);
  run_for(0.2);
  EXPECT_EQ(log.dropped(), 0);
  EXPECT_TRUE(log.good());
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
    const std::regex structs(R"(struct (\w+) \{ ([^}]*)\})"), members(R"((unsigned long|\w+) (\w+)(?:\[(\d+)\])?;)");
    for (std::sregex_iterator it(schema.begin(), schema.end(), structs), end; it != end; ++it) {
      const std::string body = (*it)[2];
      for (std::sregex_iterator m(body.begin(), body.end(), members); m != end; ++m)
        structs_[(*it)[1]].push_back({(*m)[1], (*m)[2], (*m)[3].matched ? std::stoi((*m)[3]) : 0});
    }
  }
  // The numbers by their names, "motor_cmd[18].q"; nothing where bytes are missing or left.
  std::map<std::string, double> read(const std::string& name, std::span<const std::byte> body) {
    values_.clear();
    body_ = body;
    at_ = 0;
    read_struct(name, "");
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
        if (member.type == "octet")
          values_[path] = number<std::uint8_t>();
        else if (member.type == "short")
          values_[path] = number<std::int16_t>();
        else if (member.type == "float")
          values_[path] = static_cast<double>(number<float>());
        else if (member.type == "unsigned long")
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
    EXPECT_EQ(channel.schema_encoding, "omgidl");
    const bool command = channel.topic == "rt/lowcmd";
    if (++(command ? commands : states) % 250 != 1) return;
    const std::string type = command ? "LowCmd_" : "LowState_", motor = command ? "motor_cmd[" : "motor_state[";
    ASSERT_TRUE(channel.schema_name.ends_with(type));
    std::map<std::string, double> values = SchemaReader(channel.schema).read(type, message.data.subspan(4));
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
  std::string bytes = read_file(folder / "run.mcap");
  const std::string speed = "\"arm_speed\":\"0.5\"";
  const std::size_t at = bytes.find(speed);
  ASSERT_NE(at, std::string::npos);
  bytes.replace(at, speed.size(), "\"arm_speed\":\"0.4\"");
  write_file(folder / "changed.mcap", bytes);
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { static_cast<void>(replay_log(folder / "changed.mcap")); }));
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

TEST(RunLog, ACutLogIsCoveredByChecksumsUpToTheCut) {
  const test::ScratchFolder folder;
  run_and_log(folder / "run.mcap", test::twin_guard());
  std::string bytes = read_file(folder / "run.mcap");
  bytes.resize(bytes.size() / 2);
  constexpr int kFlips = 60;
  int refused = 0;
  for (int i = 0; i < kFlips; ++i) {
    std::string flipped = bytes;
    const std::size_t at = (2 * i + 1) * bytes.size() / (2 * kFlips + 4);
    flipped[at] = static_cast<char>(flipped[at] ^ 0x10);
    write_file(folder / "flipped.mcap", flipped);
    try {
      const LogReplay replay = replay_log(folder / "flipped.mcap");
      refused += replay.different > 0 ? 1 : 0;
    } catch (const InputError&) {
      ++refused;
    }
  }
  // Flips that pass are in heads of records: a length that is too long reads as the place where the file was cut.
  EXPECT_GE(refused, kFlips - 3);
}

TEST(RunLog, ACutLogIsReplayedAsFarAsItGoes) {
  const test::ScratchFolder folder;
  run_and_log(folder / "run.mcap", test::twin_guard());
  const std::string bytes = read_file(folder / "run.mcap");
  write_file(folder / "cut.mcap", bytes.substr(0, bytes.size() / 2));
  const LogReplay replay = replay_log(folder / "cut.mcap");
  EXPECT_GT(replay.ticks, 1000);
  EXPECT_EQ(replay.different, 0);
  EXPECT_FALSE(replay.whole);
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
